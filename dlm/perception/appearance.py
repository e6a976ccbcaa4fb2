"""From colours to coverage: background, lighting and object colour of a video, robustly; then each pixel's share of object."""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from datasets.render import Camera, Frames, ground_coverage
from dlm.perception.background import Background, background_of
from expert.errors import InvalidProblem
from expert.geometry.polygon import NDArrayBool
from expert.geometry.pose import Array

MODEL_ERROR = 0.004
"""Standard deviation of what no exact coverage explains, the renderer's own errors among it [share of a pixel]."""
FOREIGN = 25.0
"""A colour this far from every mixture of object and background is something else [grey levels]."""
FAINTEST = 12.0
"""Colours differ from this distance on [grey levels]."""
LEAST_MOVING = 0.03
"""Of a thing that moves, so much changes colour at least."""
FEWEST = 8
"""Pixels that tell the object's colour."""
BRIGHTNESS = np.array([0.299, 0.587, 0.114])
"""Of red, green and blue (ITU-R BT.601), as compression has it."""
SAME_FRAME = np.pad(np.ones((1, 3, 3)), ((1, 1), (0, 0), (0, 0)))
"""Neighbours of a pixel of (T, h, w)."""
CROSS = np.array([[[0, 1, 0], [1, 1, 1], [0, 1, 0]]])


@dataclass(frozen=True)
class Appearance:
    """Images with row 0 at the bottom.

    share: the object's part of each pixel (T, h, w), outside [0, 1] by noise.  precision: its inverse variance.
    foreign: pixels whose colour is no mixture of background and object (T, h, w), as where something is in front.
    noise: standard deviation of a channel [grey levels].  contrast: between object and background (h, w) [grey levels].
    """

    share: Array
    precision: Array
    foreign: Array
    noise: float
    contrast: Array


def separate(video: Frames, camera: Camera, floor: bool, blur: float = 0.0, codec: float = 0.0) -> Appearance:
    """Unmix a video of one object; see PerceptionSettings.  Raises InvalidProblem where nothing stands out from the background.

    The object is above the floor, so that it hides the wall alone, even where a pixel or the blur mixes all three.
    """
    images = video[:, ::-1].astype(float)
    ground = ground_coverage(camera)[::-1] if floor else np.zeros((camera.size, camera.size))
    if blur > 0:
        ground = ndimage.gaussian_filter1d(ground, blur, axis=0, mode="nearest")
    behind = background_of(images, ground)
    light, noise = behind.light, float(np.hypot(behind.noise, codec))
    plain = images / light[..., None]
    line = _object_colour(plain, behind, noise, blur) - behind.wall
    length = float(line @ line)
    share = ((plain - behind.image) * line).sum(axis=-1) / length
    off = np.linalg.norm(plain - behind.image - share[..., None] * line, axis=-1) * light
    contrast = light * length**0.5
    precision = 1 / ((noise / contrast) ** 2 + MODEL_ERROR**2)
    odd = off > max(6 * noise, FOREIGN)
    # What moves along, as fingers do, mixes its colour into the outline all the way.
    strange = off > max(FOREIGN, _colour_error(behind, line, ground) * float(np.median(light)))
    odd |= ndimage.binary_dilation(_around(strange, odd) & ~odd.all(axis=0), CROSS, iterations=2)
    foreign = odd | _half_covered_areas(share, noise / contrast)
    foreign |= _standing(np.where(foreign, 0.0, share))
    return Appearance(share, np.broadcast_to(precision, share.shape), foreign, noise, contrast)


def _half_covered_areas(share: Array, deviation: Array) -> NDArrayBool:
    """Areas of one colour between background and object, or beyond the object's: nothing that an outline makes."""
    lowest, highest, mean = (
        f(share, size=(1, 3, 3))
        for f in (ndimage.minimum_filter, ndimage.maximum_filter, ndimage.uniform_filter)
    )
    flat = highest - lowest < 0.1 + 5 * deviation
    odd = flat & (np.abs(mean - np.clip(np.rint(mean), 0, 1)) > 0.12 + deviation)
    return np.asarray(ndimage.binary_dilation(odd, np.ones((1, 3, 3))))


def _around(cores: NDArrayBool, masks: NDArrayBool) -> NDArrayBool:
    """The connected pieces of each mask (T, h, w) that contain a core."""
    return np.asarray(ndimage.binary_propagation(cores & masks, SAME_FRAME, masks))


def _colour_error(behind: Background, line: Array, ground: Array) -> float:
    """By how much compression may change a pixel [grey levels]: it keeps brightness, but gives it a neighbour's hue."""
    colours = np.stack([behind.wall, behind.wall + line, behind.image.reshape(-1, 3)[ground.argmax()]])
    hues = colours - (colours @ BRIGHTNESS)[:, None]
    return float(np.linalg.norm(hues[:, None] - hues, axis=-1).max())


def _standing(share: Array) -> NDArrayBool:
    """Pieces in the object's colour that stand still while others move (T, h, w); nothing where all of them stand."""
    moved = np.ptp(share, axis=0) > 0.5
    things = share > 0.5
    moving = _pieces_with(moved, things, 0.0)
    if not moving.any(axis=(1, 2)).all():
        return np.zeros_like(things)
    return np.asarray(ndimage.binary_dilation(things & ~moving, CROSS))


def _object_colour(plain: Array, behind: Background, noise: float, blur: float) -> Array:
    """The commonest colour well inside what differs from the background; where something moves, inside what moves."""
    difference = np.linalg.norm(plain - behind.image, axis=-1)
    different = difference > max(5 * noise, FAINTEST)
    # What compression leaves near edges stays where it is, and needs no allowance here.
    moves = np.linalg.norm(np.ptp(plain, axis=0), axis=-1) > max(8 * behind.noise, 2 * FAINTEST)
    moving = _pieces_with(moves, different, LEAST_MOVING)
    if moving.any():
        different = moving
    for depth in range(1 + int(np.ceil(2 * blur)), -1, -1):
        inner = ndimage.binary_erosion(different, CROSS, iterations=depth) if depth else different
        if inner.sum() >= FEWEST:
            colours = plain[inner][:: max(1, int(inner.sum()) // 400)]
            distances = np.linalg.norm(colours[:, None] - colours, axis=-1)
            alike = distances < max(4 * noise, FAINTEST)
            return np.median(colours[alike[alike.sum(axis=1).argmax()]], axis=0)
    raise InvalidProblem(
        "video",
        expected="an object that stands out from its background",
        got="background only",
        remedy="show the object in every frame, in another colour than the background",
    )


def _pieces_with(mark: NDArrayBool, masks: NDArrayBool, least: float) -> NDArrayBool:
    """The connected pieces of each mask (T, h, w) of which a larger share than `least` is marked (h, w)."""
    kept = np.zeros_like(masks)
    for t, mask in enumerate(masks):
        pieces, count = ndimage.label(mask)
        area, marked = (np.bincount(pieces[m], minlength=count + 1) for m in (mask, mask & mark))
        kept[t] = mask & (marked > least * area)[pieces]
    return kept
