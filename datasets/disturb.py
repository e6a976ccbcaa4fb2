"""Videos as a real camera might give them: noise, blur, things in front, uneven light, other colours.  Pure functions.

Every function takes frames (T, h, w, 3) uint8 and returns new ones; what is random takes its generator.
"""

from collections.abc import Callable

import cv2
import numpy as np

from datasets.render import Colour, Frames, Palette
from expert.geometry.pose import Array
from expert.world.values import require


def noisy(video: Frames, deviation: float, rng: np.random.Generator) -> Frames:
    """Independent Gaussian noise on every channel, of this standard deviation [grey levels, 0 to 255]."""
    require(0 <= deviation < np.inf, "noise.deviation", "a number of grey levels >= 0", deviation)
    return _to_levels(video + rng.normal(0, deviation, video.shape))


def blurred(video: Frames, deviation: float) -> Frames:
    """Gaussian blur of this standard deviation [pixels]."""
    require(0 < deviation <= 10, "blur.deviation", "a positive number of pixels, at most 10", deviation)
    return np.stack(
        [cv2.GaussianBlur(frame, (0, 0), deviation, borderType=cv2.BORDER_REPLICATE) for frame in video]
    )


def occluded(video: Frames, patches: int, size: tuple[int, int], rng: np.random.Generator) -> Frames:
    """Rectangles of random colours in front of the scene, the same in every frame.

    size: least and greatest side [pixels].  They lie anywhere within the frame.
    """
    require(patches >= 0, "occlusion.patches", "a number >= 0", patches)
    height, width = video.shape[1:3]
    require(1 <= size[0] <= size[1] <= min(height, width), "occlusion.size", "1 <= least <= greatest", size)
    out = video.copy()
    for _ in range(patches):
        rows, columns = rng.integers(size[0], size[1] + 1, 2)
        top, left = rng.integers(0, height - rows + 1), rng.integers(0, width - columns + 1)
        out[:, top : top + rows, left : left + columns] = rng.integers(0, 256, 3)
    return out


def unevenly_lit(video: Frames, slope: Array) -> Frames:
    """Brightness times 1 + slope . (x, y), where x and y run from -1/2 to 1/2 over the frame, y upwards; at most 255."""
    slope = np.asarray(slope, dtype=float)
    require(
        slope.shape == (2,) and np.abs(slope).sum() < 2,
        "light.slope",
        "two numbers that add up to less than 2",
        slope,
    )
    height, width = video.shape[1:3]
    y, x = np.meshgrid(
        0.5 - (np.arange(height) + 0.5) / height, (np.arange(width) + 0.5) / width - 0.5, indexing="ij"
    )
    return _to_levels(video * (1 + slope[0] * x + slope[1] * y)[..., None])


def random_palette(rng: np.random.Generator, contrast: float = 100.0) -> Palette:
    """Colours drawn from the whole cube, each pair at least `contrast` grey levels apart (Euclidean)."""
    require(0 <= contrast <= 200, "palette.contrast", "0 to 200 grey levels", contrast)
    while True:
        colours = rng.integers(0, 256, (3, 3))
        distances = np.linalg.norm(colours - np.roll(colours, 1, axis=0), axis=1)
        if distances.min() >= contrast:
            background, thing, ground = (_colour(c) for c in colours)
            return Palette(background=background, object=thing, ground=ground)


def _colour(values: Array) -> Colour:
    red, green, blue = (int(v) for v in values)
    return red, green, blue


def _to_levels(values: Array) -> Frames:
    return np.clip(np.rint(values), 0, 255).astype(np.uint8)


Disturbance = Callable[[Frames, np.random.Generator], Frames]


def random_light(video: Frames, rng: np.random.Generator, strength: float = 0.5) -> Frames:
    """Uneven light from a random side: darker by `strength` of the mean from one side of the frame to the other."""
    angle = rng.uniform(0, 2 * np.pi)
    # Dimmed first, so that the bright side does not saturate.
    dimmed = _to_levels(video / (1 + strength))
    return unevenly_lit(dimmed, strength * np.array([np.cos(angle), np.sin(angle)]))


DISTURBANCES: dict[str, Disturbance] = {
    "clean": lambda video, rng: video,
    "noise 3": lambda video, rng: noisy(video, 3, rng),
    "noise 5": lambda video, rng: noisy(video, 5, rng),
    "noise 15": lambda video, rng: noisy(video, 15, rng),
    "blur 1": lambda video, rng: blurred(video, 1.0),
    "occlusion": lambda video, rng: occluded(video, 3, (3, 8), rng),
    "light": random_light,
}
"""Named settings that benchmarks report; colours are a matter of the renderer (`random_palette`)."""
