"""The first look at a frame: where are the agent and the block, from nothing."""

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from dlm.control.fit import fit_disc, fit_pose
from dlm.control.picture import COLOURS, SCALE, SIZE, Pixels, places
from expert.errors import InvalidProblem
from expert.geometry.pose import Array, rotation
from expert.pushing.outline import Outline

ANGLES, CAUGHT, FINALISTS = 48, 6, 2
"""Directions that are compared, fitted coarsely, and fitted finely."""
COARSE, FINE = 12.0, 4.0
"""Widths of the colour ramps [pixels of the surface]: wide to be caught from afar, narrow to be exact."""
BLUE = 60.0
"""The agent is where blue exceeds the mean of red and green by this over 5 x 5 samples, the size of its disc; the block's
colours reach half of it."""
BLOCK_BIAS, AGENT_BIAS = np.array([-0.26, 0.07, 0.0]), np.array([-0.51, -0.52])
"""Of the fits against the true places, measured on 145 frames: the painter rounds to whole pixels, not evenly."""
FREE = np.zeros(3)


class Frame(NamedTuple):
    """A frame for fitting: colours (96, 96, 3) in the light of the colour table."""

    colours: Array


class Stage(NamedTuple):
    """What does not change from frame to frame: outline, empty scene, places of the samples, radii of block and agent."""

    edges: Outline
    empty: Array
    places: Array
    reach: float
    radius: float


def stage(edges: Outline, empty: Array, radius: float) -> Stage:
    """Of an outline about its own origin."""
    reach = float(np.linalg.norm(edges.starts, axis=1).max())
    return Stage(edges, empty, places(), reach, radius)


def frame_of(pixels: object) -> Frame:
    """A checked frame, with the light evened out: most of the ground is white.  Raises InvalidProblem."""
    image = np.asarray(pixels)
    if image.shape != (96, 96, 3) or image.dtype != np.uint8:
        got = f"{image.dtype} of shape {image.shape}"
        raise InvalidProblem(
            "pixels", expected="uint8 of shape (96, 96, 3)", got=got, remedy="do not scale it"
        )
    light = float(np.median(image))
    if light < 64:
        raise InvalidProblem(
            "pixels", expected="a picture of Push-T on white ground", got=f"median {light:g}"
        )
    return Frame(image * (255.0 / light))


def near(at: Stage, frame: Frame, centre: Array, reach: float, agent: Array | None) -> Pixels:
    """Samples within reach of a centre (2,), without those that the agent may hide."""
    low = np.clip(np.floor((centre - reach) / SCALE), 0, SIZE).astype(int)
    high = np.clip(np.ceil((centre + reach) / SCALE) + 1, 0, SIZE).astype(int)
    part = np.s_[low[1] : high[1], low[0] : high[0]]
    spots = at.places[part]
    kept = ((spots - centre) ** 2).sum(-1) < reach**2
    if agent is not None:
        kept &= ((spots - agent) ** 2).sum(-1) > (at.radius + 5) ** 2
    return Pixels(spots[kept], frame.colours[part][kept], at.empty[part][kept])


def find_agent(at: Stage, frame: Frame) -> Array | None:
    """Centre (2,) of the agent's disc; None where too little of it shows."""
    red, green, blue = np.moveaxis(frame.colours, -1, 0)
    blueness = np.maximum(blue - (red + green) / 2, 0.0)
    mean = cv2.blur(blueness, (5, 5))
    peak = np.unravel_index(mean.argmax(), mean.shape)
    if mean[peak] < BLUE:
        return None
    window = ((at.places - at.places[peak]) ** 2).sum(-1) < (1.5 * at.radius) ** 2
    weight = np.where(window, np.maximum(blueness - BLUE, 0.0), 0.0)
    start = (weight[..., None] * at.places).sum(axis=(0, 1)) / weight.sum()
    return fit_disc(at.radius, start, near(at, frame, start, 3 * at.radius, None), FINE, 8) - AGENT_BIAS


def _block_samples(at: Stage, frame: Frame, agent: Array | None) -> NDArray[np.bool_]:
    """Mask (96, 96): the largest patch in the block's colours; rims of other things have them too."""
    smooth = cv2.blur(frame.colours, (3, 3))
    nearest = ((smooth[..., None, :] - COLOURS) ** 2).sum(-1).argmin(-1)
    kept = (nearest == 3) | (nearest == 4)
    hidden = np.zeros_like(kept)
    if agent is not None:
        hidden = ((at.places - agent) ** 2).sum(-1) < (at.radius + 5) ** 2
    _, labels, sizes, _ = cv2.connectedComponentsWithStats((kept | hidden).astype(np.uint8))
    sizes[0] = 0  # the rest
    return (labels == sizes[:, cv2.CC_STAT_AREA].argmax()) & kept & ~hidden


def find_block(at: Stage, frame: Frame, centroid: Array, agent: Array | None) -> tuple[Array, int, float]:
    """Pose (3,), the piece painted last, and mean squared error; centroid (2,): of the block's area in its frame."""
    kept = _block_samples(at, frame, agent)
    if kept.sum() < 20:
        raise InvalidProblem(
            "pixels", expected="the block in view", got=f"{kept.sum()} samples of its colours"
        )
    centre = at.places[kept].mean(axis=0)
    pixels = near(at, frame, centre, at.reach + 12, agent)
    coarse = Pixels(*(rows[::2] for rows in pixels))
    angles = np.arange(ANGLES) * 2 * np.pi / ANGLES
    starts = np.column_stack([centre - centroid @ np.swapaxes(rotation(angles), -1, -2), angles])
    compared = [fit_pose(at.edges, 0, start, coarse, COARSE, 0, start, FREE)[1] for start in starts]
    caught = starts[np.argsort(compared)[:CAUGHT]]
    tried = [fit_pose(at.edges, 0, start, coarse, COARSE, 6, start, FREE) for start in caught]
    tried.sort(key=lambda found: found[1])
    fits = [
        (*fit_pose(at.edges, last, start, pixels, FINE, 12, start, FREE), last)
        for start, _ in tried[:FINALISTS]
        for last in range(len(at.edges.first) - 1)
    ]
    pose, error, last = min(fits, key=lambda found: found[1])
    return pose - BLOCK_BIAS, last, error


def follow_block(at: Stage, frame: Frame, guess: Array, last: int, agent: Array) -> tuple[Array, float]:
    """Pose (3,) near a guess, and mean squared error."""
    pixels = near(at, frame, guess[:2], at.reach + 12, agent)
    pose, error = fit_pose(at.edges, last, guess + BLOCK_BIAS, pixels, FINE, 12, guess, FREE)
    return pose - BLOCK_BIAS, error
