"""Where the floor and the object are in a video, and the part of it that perception is shown."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from datasets.render import Camera, Frames
from dlm.perception.appearance import separate
from dlm.perception.segment import segment
from expert.errors import InvalidProblem
from expert.geometry.polygon import NDArrayBool
from expert.geometry.pose import Array
from expert.world.values import IntArray, require

COARSE = 96
"""Side of the picture in which the object is looked for [pixels]."""
AROUND = 6.0
"""Kept around the object's motion [pixels of that]."""
BESIDE = 0.1
"""Kept clear around an outline, over its extent."""
LIKE_THE_WALL = 40.0
"""What continues beyond the picture: colours no further from the wall's than this [grey levels]."""
THINNEST = 0.05
"""A band at the lower edge that is lower than this share of the picture, with another edge above it, is no floor."""
VISIBLE = 12.0
"""Least contrast between ground and background that counts as an edge [grey levels]."""


@dataclass(frozen=True, kw_only=True)
class View:
    """What perception is shown: frames (T, s, s, 3) of `camera`.

    width, height, floor: of the video, and row of the floor's surface in it [pixels]; scale [m per pixel of the video].
    World coordinates: x = 0 in the middle of the video, y = 0 on the floor.
    """

    frames: Frames
    camera: Camera
    width: int
    height: int
    floor: float
    scale: float

    def to_pixels(self, points: Array) -> Array:
        """World points (..., 2) [m] in pixels (column, row) of the video."""
        return np.stack(
            [self.width / 2 + points[..., 0] / self.scale, self.floor - points[..., 1] / self.scale], -1
        )

    def around(self, outlines: Array) -> NDArrayBool:
        """Pixels of the video (height, width) in the boxes around outlines (T, V, 2) [m], and a margin."""
        mask = np.zeros((self.height, self.width), dtype=bool)
        for corners in self.to_pixels(outlines):
            margin = BESIDE * np.ptp(corners, axis=0).max()
            left, top = np.maximum(np.floor(corners.min(axis=0) - margin), 0).astype(int)
            right, bottom = np.ceil(corners.max(axis=0) + margin).astype(int)
            mask[top:bottom, left:right] = True
        return mask

    def scaled(self, factor: float) -> "View":
        """The same view, if its pixels were so many times as large."""
        camera = self.camera
        return replace(
            self,
            scale=self.scale * factor,
            camera=replace(
                camera,
                scale=camera.scale * factor,
                centre=camera.centre * factor,
                below=camera.below * factor,
            ),
        )


def find_floor(frames: Frames) -> float | None:
    """Row of the ground's upper edge [pixels, continuous]; None where no ground stands out at the lower edge.

    A thin strip at the lower edge, before the ground, is left out.
    """
    rows = np.median(frames.astype(float), axis=(0, 2))
    edge = _lowest_edge(rows)
    if edge is None or edge < (1 - THINNEST) * len(rows):
        return edge
    above = _lowest_edge(rows[: int(edge) - 1])
    return edge if above is None else above


def _lowest_edge(rows: Array) -> float | None:
    """Where the colour of the lowest rows (n, 3) begins, if it is not that of the upper third."""
    ground, background = np.median(rows[-2:], axis=0), np.median(rows[: max(2, len(rows) // 3)], axis=0)
    line = ground - background
    if np.linalg.norm(line) < VISIBLE:
        return None
    share = np.clip((rows - background) @ line / (line @ line), 0, 1)
    first = len(rows) - int(np.argmax(share[::-1] < 0.5))  # ground from here to the lower edge
    line = np.median(rows[first : first + 5][-4:], axis=0) - background  # of the ground next to its edge
    share = np.clip((rows - background) @ line / (line @ line), 0, 1)
    return float(first - share[:first][-2:].sum() + (1 - share[first : first + 2]).sum())


def view_of(frames: Frames, *, scale: float, floor: float, extent: float) -> View:
    """Look for the object, and cut out a square around its motion and the floor under it.

    floor: row of its surface.  extent: of the object in the view, where the video has that many pixels or more.  Raises InvalidProblem (field video) unless one object stays in view.
    """
    height, width = frames.shape[1:3]
    require(0 < floor <= height, "floor", f"a row from 0 to {height}", floor)
    left, top, right, bottom, own = _find_object(frames, floor)
    shrink = max(1.0, own / extent)
    margin = AROUND * shrink
    lower = max(bottom + margin, floor + margin)
    side = int(np.ceil(max(right - left + 2 * margin, lower - top + margin)))
    if shrink == 1.0 and height == width and side >= 0.6 * width:
        side, x, y = width, 0, 0  # a small picture is shown as it is
    else:
        x, y = round((left + right - side) / 2), round(lower - side)
    size = max(4, round(side / shrink))
    camera = Camera(
        size=size,
        scale=scale * side / size,
        centre=scale * (x + side / 2 - width / 2),
        below=scale * max(0.0, y + side - floor),
    )
    shown = np.stack([_resized(part, size) for part in _cut(frames, x, y, side, floor)])
    return View(frames=shown, camera=camera, width=width, height=height, floor=floor, scale=scale)


def _find_object(frames: Frames, floor: float) -> tuple[float, float, float, float, float]:
    """Box around the object's motion (left, top, right, bottom) and its greatest extent in one frame [pixels]."""
    height, width = frames.shape[1:3]
    side = max(height, width)
    x, y = (width - side) // 2, height - side
    size = min(side, COARSE)
    small = np.stack([_resized(part, size) for part in _cut(frames, x, y, side, floor)])
    below = (height - floor) / side
    camera = Camera(size=size, scale=1.0, below=size * below)
    look = separate(small, camera, floor=True, blur=0.0)
    masks = segment(look, margin=0).masks[:, ::-1]
    places = [np.argwhere(mask) for mask in masks]
    _check_in_view(places, np.array([y, x]), np.array([height, width]), side / size)
    low = np.min([p.min(axis=0) for p in places], axis=0)
    high = np.max([p.max(axis=0) for p in places], axis=0) + 1
    extent = max(float(np.ptp(p, axis=0).max() + 1) for p in places)
    (top, left), (bottom, right) = low * side / size + [y, x], high * side / size + [y, x]
    return left, top, right, bottom, extent * side / size


def _check_in_view(places: Sequence[IntArray], corner: IntArray, size: IntArray, pixel: float) -> None:
    """Raise InvalidProblem where the object's places (n, 2) in a small picture, whose corner is there in the video, touch the
    video's edge."""
    for t, place in enumerate(places):
        low, high = place.min(axis=0) * pixel + corner, (place.max(axis=0) + 1) * pixel + corner
        if (low < pixel).any() or (high > size - pixel).any():
            raise InvalidProblem(
                "video",
                expected="the whole object inside every frame",
                got=f"one that leaves frame {t}",
                remedy="move the camera back or cut the clip",
            )


def _cut(frames: Frames, x: int, y: int, side: int, floor: float) -> Frames:
    """A square of every frame; beyond the frame its border goes on where that is wall or ground, else wall or ground do."""
    height, width = frames.shape[1:3]
    rows = np.clip(np.arange(y, y + side), 0, height - 1)
    columns = np.clip(np.arange(x, x + side), 0, width - 1)
    square = frames[:, rows[:, None], columns]
    for name, beyond in (("wall", rows < floor), ("ground", rows >= floor)):
        known = frames[:, : int(floor)] if name == "wall" else frames[:, int(np.ceil(floor)) :]
        outside = np.zeros((side, side), dtype=bool)
        outside[beyond] = (rows != np.arange(y, y + side))[beyond, None] | (columns != np.arange(x, x + side))
        if known.size and outside.any():
            plain = np.median(known[:, ::4, ::4].reshape(-1, 3), axis=0)
            strange = np.linalg.norm(square - plain, axis=-1) > LIKE_THE_WALL
            square[strange & outside] = np.rint(plain)
    return square


def _resized(frame: Frames, size: int) -> Frames:
    """Every pixel the mean of what it covers."""
    if len(frame) == size:
        return frame
    return np.asarray(cv2.resize(frame, (size, size), interpolation=cv2.INTER_AREA), dtype=np.uint8)


def lowest_row(frames: Frames) -> float:
    """Row of the lower edge of the object in the first frame: where it stands if the floor itself cannot be seen."""
    try:
        _, _, _, bottom, _ = _find_object(frames[:1].repeat(2, axis=0), float(frames.shape[1]))
    except InvalidProblem:
        return float(frames.shape[1])  # whatever is wrong is said where the whole video is looked at
    return bottom
