"""From colours to coverage: background, lighting and object colour of a video, robustly; then each pixel's share of object."""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from datasets.render import Camera, Frames, ground_coverage
from expert.errors import InvalidProblem
from expert.geometry.polygon import NDArrayBool
from expert.geometry.pose import Array

LEAST_NOISE = 0.5
"""Standard deviation that is assumed of a pixel at least [grey levels]: it is rounded."""
MODEL_ERROR = 0.004
"""Standard deviation of what no exact coverage explains, the renderer's own errors among it [share of a pixel]."""
FOREIGN = 25.0
"""A colour this far from every mixture of object and background is something else [grey levels]."""
PURE = 1e-3
"""A pixel with less of the ground shows the wall alone."""
FAINTEST = 12.0
"""Colours differ from this distance on [grey levels]."""
FEWEST = 8
"""Pixels that tell the object's colour."""
CROSS = np.array([[[0, 1, 0], [1, 1, 1], [0, 1, 0]]])
EVERY = 6
"""Of so many pixels one tells of background and lighting."""


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
    light, wall, background, plain_noise = _background(images, ground)
    noise = float(np.hypot(plain_noise, codec))
    plain = images / light[..., None]
    line = _object_colour(plain, background, noise, blur) - wall
    length = float(line @ line)
    share = ((plain - background) * line).sum(axis=-1) / length
    off = np.linalg.norm(plain - background - share[..., None] * line, axis=-1) * light
    contrast = light * length**0.5
    precision = 1 / ((noise / contrast) ** 2 + MODEL_ERROR**2)
    foreign = (off > max(6 * noise, FOREIGN)) | _half_covered_areas(share, noise / contrast)
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


def _background(images: Array, ground: Array) -> tuple[Array, Array, Array, float]:
    """Lighting (h, w) around 1, under even light colours of the wall (3,) and of wall and ground (h, w, 3), noise.

    Brightness is lighting times the colour of the wall or the ground: its logarithm is a sum, fitted robustly to
    pixels of either; what is neither (the object, something in front) differs in hue or brightness and is left out.
    """
    basis = _smooth_basis(*ground.shape)
    regions = np.stack([region for region in (ground < PURE, ground > 1 - PURE) if region.any()], axis=-1)
    count = regions.shape[-1]
    design = np.concatenate([regions.astype(float), basis], axis=-1)
    y, x = np.indices(ground.shape)
    known = np.broadcast_to(np.any(regions, axis=-1) & ((x + 2 * y) % EVERY == 0), images.shape[:3])
    sample, where = images[known], np.broadcast_to(design, (*known.shape, design.shape[-1]))[known]
    region = where[:, :count].argmax(axis=-1)
    brightness = np.maximum(sample.sum(axis=-1), 1.0)
    hue: Array = sample / brightness[:, None]
    typical = np.array([np.median(hue[region == k], axis=0) for k in range(count)])
    tinted = np.linalg.norm(hue - typical[region], axis=-1) * brightness
    inside = tinted < 3 * np.median(tinted) + 3
    level = np.array([np.median(brightness[region == k]) for k in range(count)])
    rest = np.log(brightness) - np.log(level[region])
    for _ in range(6):
        spread = 1.4826 * np.median(np.abs(rest[inside]))
        near = inside & (np.abs(rest) < 2.5 * spread + 3 / brightness)
        weight = np.where(near, brightness**2, 0)
        weight /= weight.max()
        matrix = where.T @ (weight[:, None] * where) + 1e-6 * np.eye(design.shape[-1])
        surface = np.linalg.solve(matrix, where.T @ (weight * np.log(brightness)))
        rest = np.log(brightness) - where @ surface
    light = np.exp(np.clip(basis @ surface[count:], -1.5, 1.5))
    even = sample / np.broadcast_to(light, known.shape)[known][:, None]
    colours = [np.median(even[near & (region == k)], axis=0) for k in range(count)]
    background = colours[0] + ground[..., None] * (colours[-1] - colours[0])
    off = (
        sample - (even * 0 + np.array(colours)[region]) * np.broadcast_to(light, known.shape)[known][:, None]
    )[near]
    noise = 1.4826 * float(np.median(np.abs(off - np.median(off, axis=0))))
    return light, colours[0], background, max(noise, LEAST_NOISE)


def _smooth_basis(height: int, width: int) -> Array:
    """Polynomials of second degree over the image without the constant, (h, w, 5)."""
    y, x = np.meshgrid(np.linspace(-1, 1, height), np.linspace(-1, 1, width), indexing="ij")
    return np.stack([x, y, x * x, x * y, y * y], axis=-1)


def _object_colour(plain: Array, background: Array, noise: float, blur: float) -> Array:
    """The commonest colour well inside what differs from the background; where something moves, inside what moves."""
    difference = np.linalg.norm(plain - background, axis=-1)
    different = difference > max(5 * noise, FAINTEST)
    moves = np.linalg.norm(np.ptp(plain, axis=0), axis=-1) > max(8 * noise, 2 * FAINTEST)
    if (different & moves).any():
        different = _pieces_with(moves, different)
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


def _pieces_with(mark: NDArrayBool, masks: NDArrayBool) -> NDArrayBool:
    """The connected pieces of each mask (T, h, w) that contain a marked pixel (h, w)."""
    kept = np.zeros_like(masks)
    for t, mask in enumerate(masks):
        pieces, _ = ndimage.label(mask)
        kept[t] = mask & np.isin(pieces, np.unique(pieces[mask & mark]))
    return kept
