"""The scene without the object: wall, ground and smooth lighting, and the camera's noise."""

from dataclasses import dataclass

import numpy as np

from expert.geometry.polygon import NDArrayBool
from expert.geometry.pose import Array
from expert.world.values import IntArray

LEAST_NOISE = 0.5
"""Standard deviation that is assumed of a pixel at least [grey levels]: it is rounded."""
PURE = 1e-3
"""A pixel with less of the ground shows the wall alone."""
EVERY = 6
"""Of so many pixels one is asked."""
DARKEST = 1.0
"""Least brightness, red, green and blue together [grey levels]."""
PASSES = 6


@dataclass(frozen=True)
class Background:
    """light (h, w): lighting, around 1.  Under even light: wall (3,), its colour, and image (h, w, 3), wall and ground.

    noise: standard deviation of a channel [grey levels].
    """

    light: Array
    wall: Array
    image: Array
    noise: float


def background_of(images: Array, ground: Array) -> Background:
    """From images (T, h, w, 3) and the ground's share of each pixel (h, w), most of which show no object.

    Brightness is lighting times the colour of wall or ground: its logarithm is a sum, fitted robustly to both.  What is
    neither (the object, something in front) differs in hue or brightness and is left out.
    """
    regions = np.stack([r for r in (ground < PURE, ground > 1 - PURE) if r.any()], axis=-1)
    basis = _smooth_basis(*ground.shape)
    y, x = np.indices(ground.shape)
    asked = np.any(regions, axis=-1) & ((x + 2 * y) % EVERY == 0)
    pixels = images[:, asked].reshape(-1, 3)
    terms = np.tile(np.concatenate([regions, basis], axis=-1)[asked], (len(images), 1))
    region = terms[:, : regions.shape[-1]].argmax(axis=-1)
    surface, trusted = _brightness(pixels, terms, region)
    smooth = np.s_[regions.shape[-1] :]
    lit = np.exp(np.clip(terms[:, smooth] @ surface[smooth], -1.5, 1.5))
    colours = _medians(pixels / lit[:, None], region, trusted)
    rest = (pixels - colours[region] * lit[:, None])[trusted if trusted.any() else slice(None)]
    return Background(
        light=np.exp(np.clip(basis @ surface[smooth], -1.5, 1.5)),
        wall=colours[0],
        image=colours[0] + ground[..., None] * (colours[-1] - colours[0]),
        noise=max(1.4826 * float(np.median(np.abs(rest - np.median(rest, axis=0)))), LEAST_NOISE),
    )


def _brightness(pixels: Array, terms: Array, region: IntArray) -> tuple[Array, NDArrayBool]:
    """Coefficients of log brightness by iterated, trimmed least squares; and which pixels (n,) were not left out."""
    brightness = np.maximum(pixels.sum(axis=-1), DARKEST)
    everywhere = np.ones(len(pixels), dtype=bool)
    hue: Array = pixels / brightness[:, None]
    tint = np.linalg.norm(hue - _medians(hue, region, everywhere)[region], axis=-1) * brightness
    plain = tint < 3 * np.median(tint) + 3
    height = np.log(brightness)
    rest = height - _medians(height[:, None], region, everywhere)[region, 0]
    near, surface = plain, np.zeros(terms.shape[-1])
    for _ in range(PASSES):
        spread = 1.4826 * float(np.median(np.abs(rest[plain])))
        near = plain & (np.abs(rest) < 2.5 * spread + 3 / brightness)
        # The same noise moves the logarithm of a dark pixel further.
        weight = np.where(near, (brightness / brightness.max()) ** 2, 0)
        matrix = terms.T @ (weight[:, None] * terms) + 1e-6 * np.eye(terms.shape[-1])
        surface = np.linalg.solve(matrix, terms.T @ (weight * height))
        rest = height - terms @ surface
    return surface, near


def _medians(values: Array, region: IntArray, chosen: NDArrayBool) -> Array:
    """Of the chosen values (n, k) of each region, or of all of them where none is chosen: (regions, k)."""
    medians = []
    for k in range(region.max() + 1):
        here = region == k
        medians.append(np.median(values[here & chosen] if (here & chosen).any() else values[here], axis=0))
    return np.array(medians)


def _smooth_basis(height: int, width: int) -> Array:
    """Polynomials of second degree over the image without the constant, (h, w, 5)."""
    y, x = np.meshgrid(np.linspace(-1, 1, height), np.linspace(-1, 1, width), indexing="ij")
    return np.stack([x, y, x * x, x * y, y * y], axis=-1)
