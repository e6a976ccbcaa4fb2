"""Video frames of a moving polygon over the floor.  The one place that knows pixels.

Colour is blended by the share of the pixel that each thing covers, so that a frame tells positions to a small part of
a pixel: OpenCV fills the polygon on a grid `SUPERSAMPLING` times finer, and the mean over each pixel is its coverage.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Annotated

import cv2
import numpy as np

from datasets.limits import Number, check_numbers
from expert.geometry.polygon import facet_frames
from expert.geometry.pose import Array, to_world
from expert.world.values import require

Frames = np.ndarray[tuple[int, ...], np.dtype[np.uint8]]
Colour = tuple[int, int, int]

SUPERSAMPLING = 16
SUBPIXEL_BITS = 8
"""Binary places of the coordinates that OpenCV is given."""


@dataclass(frozen=True, kw_only=True)
class Camera:
    """Orthographic view of the plane, x to the right, y up.

    size: pixels per side.  scale [m per pixel].  centre: world x of the image's middle [m].  below: what is seen below
    the floor's surface y = 0 [m].  Pixel coordinates (column, row) are continuous, (0, 0) at the upper left corner.
    """

    size: Annotated[int, Number(unit="pixels", whole=True, least=4, most=4096)] = 50
    scale: Annotated[float, Number(unit="metres per pixel", above=0, most=1e6)] = 0.004
    centre: Annotated[float, Number(unit="metres")] = 0.0
    below: Annotated[float, Number(unit="metres", least=0)] = 0.02

    def __post_init__(self) -> None:
        check_numbers(self, "camera.")
        height = self.size * self.scale
        require(self.below < height, "camera.below", "less than the view's height", self.below)

    def to_pixels(self, points_w: Array) -> Array:
        """World points (..., 2) [m] in pixels (column, row)."""
        x, y = np.moveaxis(np.asarray(points_w, dtype=float), -1, 0)
        return np.stack(
            [self.size / 2 + (x - self.centre) / self.scale, self.size - (y + self.below) / self.scale], -1
        )

    def to_world(self, pixels: Array) -> Array:
        """Pixels (..., 2) (column, row) as world points [m]."""
        column, row = np.moveaxis(np.asarray(pixels, dtype=float), -1, 0)
        x = self.centre + (column - self.size / 2) * self.scale
        return np.stack([x, (self.size - row) * self.scale - self.below], -1)


@dataclass(frozen=True, kw_only=True)
class Palette:
    """RGB colours, 0 to 255."""

    background: Colour = (240, 240, 235)
    object: Colour = (215, 75, 50)
    ground: Colour = (70, 85, 105)

    def __post_init__(self) -> None:
        for name in ("background", "object", "ground"):
            object.__setattr__(self, name, checked_colour(getattr(self, name), f"palette.{name}"))


def checked_colour(colour: object, field: str) -> Colour:
    """As RGB.  Raises InvalidProblem for anything but three integers from 0 to 255."""
    numbers = tuple(colour) if isinstance(colour, Iterable) and not isinstance(colour, str) else ()
    level = Number(whole=True, least=0, most=255)
    require(
        len(numbers) == 3 and all(map(level.holds, numbers)), field, "three integers from 0 to 255", colour
    )
    red, green, blue = (int(n) for n in numbers)
    return red, green, blue


def render(
    vertices_b: Array, poses: Array, camera: Camera | None = None, palette: Palette | None = None
) -> Frames:
    """Frames (T, size, size, 3), uint8 RGB, of a polygon (V, 2) [m, body frame] at poses (T, 3)."""
    camera, palette = camera or Camera(), palette or Palette()
    background, thing, ground = (
        np.array(c, dtype=float) for c in (palette.background, palette.object, palette.ground)
    )
    scene = _blend(
        np.broadcast_to(background, (camera.size, camera.size, 3)), ground, ground_coverage(camera)
    )
    frames = [_blend(scene, thing, coverage(corners, camera)) for corners in to_world(poses, vertices_b)]
    return np.rint(frames).astype(np.uint8)


def _blend(under: Array, colour: Array, share: Array) -> Array:
    return under + share[..., None] * (colour - under)


def ground_coverage(camera: Camera) -> Array:
    """Share of each pixel that lies below y = 0, (size, size)."""
    surface = camera.to_pixels(np.zeros(2))[1]
    share = np.clip(np.arange(1, camera.size + 1) - surface, 0, 1)
    return np.repeat(share[:, None], camera.size, axis=1)


def coverage(vertices_w: Array, camera: Camera) -> Array:
    """Share of each pixel that a counter-clockwise polygon (V, 2) [m, world frame] covers, (size, size)."""
    fine = camera.size * SUPERSAMPLING
    # OpenCV also paints the cells that the outline crosses: half a cell too far on average.
    inset = _inset(vertices_w, 0.5 * camera.scale / SUPERSAMPLING)
    # OpenCV's integer coordinates are the centres of cells.
    cells = camera.to_pixels(inset) * SUPERSAMPLING - 0.5
    mask = np.zeros((fine, fine), dtype=np.uint8)
    cv2.fillPoly(mask, [np.rint(cells * 2**SUBPIXEL_BITS).astype(np.int32)], 1, cv2.LINE_8, SUBPIXEL_BITS)
    blocks = mask.reshape(camera.size, SUPERSAMPLING, camera.size, SUPERSAMPLING)
    return blocks.sum(axis=(1, 3)) / SUPERSAMPLING**2


def _inset(vertices: Array, distance: float) -> Array:
    """The polygon with every side moved inwards."""
    normal, _ = facet_frames(vertices)
    before = np.roll(normal, 1, axis=0)
    return vertices + distance * (normal + before) / (1 + (normal * before).sum(axis=1, keepdims=True))
