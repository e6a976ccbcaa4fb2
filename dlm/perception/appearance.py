"""From colours to coverage: background, lighting and object colour of a video, robustly; then each pixel's share of object."""

from dataclasses import dataclass

import numpy as np

from datasets.render import Camera, Frames, ground_coverage
from expert.errors import InvalidProblem
from expert.geometry.pose import Array

DARKEST_NOISE = 0.7
"""Least standard deviation that is assumed of a pixel [grey levels]: rounding, and the renderer's own errors."""


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


def separate(video: Frames, camera: Camera, floor: bool) -> Appearance:
    """Unmix a video of one object.  Raises InvalidProblem where nothing stands out from the background."""
    images = video[:, ::-1].astype(float)
    ground = ground_coverage(camera)[::-1] if floor else np.zeros((camera.size, camera.size))
    light, background, noise = _background(images, ground)
    plain = images / light[..., None]
    thing = _object_colour(plain, background, noise)
    line = thing - background  # (h, w, 3)
    length = (line * line).sum(axis=-1)
    share = ((plain - background) * line).sum(axis=-1) / length
    off = np.linalg.norm(plain - background - share[..., None] * line, axis=-1) * light
    contrast = light * np.sqrt(length)
    precision = np.broadcast_to((contrast / noise) ** 2, share.shape)
    return Appearance(share, precision, off > max(6 * noise, 25.0), noise, contrast)


def _background(images: Array, ground: Array) -> tuple[Array, Array, float]:
    """Lighting (h, w) around 1, background under even light (h, w, 3), noise."""
    regions = [region for region in (ground == 0, ground == 1) if region.any()]
    light, inside = np.ones(ground.shape), np.ones(images.shape[:3], dtype=bool)
    basis = _smooth_basis(*ground.shape)
    for _ in range(4):
        even = images / light[..., None]
        colours = [np.median(even[:, region][inside[:, region]], axis=0) for region in regions]
        background = colours[0] + ground[..., None] * (colours[-1] - colours[0])
        off = np.linalg.norm(even - background, axis=-1)
        brightness = (images * background).sum(-1) / (background * background).sum(-1)
        hue = np.linalg.norm(images - brightness[..., None] * background, axis=-1)
        inside = (
            (hue < 3 * np.median(hue) + 3) & (off < 4 * np.median(off) + 3) & ((ground == 0) | (ground == 1))
        )
        light = _smooth(basis, brightness, inside)
    rest = (images - light[..., None] * background)[inside]
    noise = 1.4826 * float(np.median(np.abs(rest - np.median(rest, axis=0))))
    return light, background, max(noise, DARKEST_NOISE)


def _smooth_basis(height: int, width: int) -> Array:
    """Polynomials of second degree over the image, (h, w, 6)."""
    y, x = np.meshgrid(np.linspace(-1, 1, height), np.linspace(-1, 1, width), indexing="ij")
    return np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=-1)


def _smooth(basis: Array, values: Array, inside: Array) -> Array:
    """Least squares of values (T, h, w) where `inside`; the mean over the image is 1."""
    count = inside.sum(axis=0)
    total = np.where(inside, values, 0).sum(axis=0)
    flat = basis.reshape(-1, basis.shape[-1])
    matrix = flat.T @ (count.reshape(-1, 1) * flat) + 1e-3 * np.eye(basis.shape[-1])
    surface = basis @ np.linalg.solve(matrix, flat.T @ total.ravel())
    return np.clip(surface / surface.mean(), 0.2, 5)


def _object_colour(plain: Array, background: Array, noise: float) -> Array:
    """Median colour of what differs clearly from the background."""
    difference = np.linalg.norm(plain - background, axis=-1)
    different = difference > max(5 * noise, 12.0)
    inner = different.copy()
    for axis in (1, 2):
        inner &= np.roll(different, 1, axis) & np.roll(different, -1, axis)
    chosen = inner if inner.sum() >= 4 else different
    if chosen.sum() < 4:
        raise InvalidProblem(
            "video",
            expected="an object that stands out from its background",
            got="background only",
            remedy="show the object in every frame, in another colour than the background",
        )
    return np.median(plain[chosen], axis=0)
