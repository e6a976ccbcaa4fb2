"""Push-T's picture as a function of the block's pose and the agent's place, for fitting.

The environment paints on a surface of 512 pixels and samples it, without smoothing, at every 16/3 of them.  A shape's
colour at a sample follows from its signed distance: fill, outline, or what lies below, over a ramp of chosen width.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from expert.geometry.pose import Array
from expert.pushing.outline import Outline, clearance, distance_up_to

SURFACE, SIZE = 512, 96
SCALE = SURFACE / SIZE
WHITE = np.array([255.0, 255.0, 255.0])
GOAL = np.array([144.0, 238.0, 144.0])
WALL = np.array([222.0, 222.0, 222.0])
EDGE, FILL = np.array([119.0, 136.0, 153.0]), np.array([143.0, 163.0, 184.0])
RING, CORE = np.array([65.0, 105.0, 225.0]), np.array([78.0, 126.0, 255.0])
COLOURS = np.stack([WHITE, GOAL, WALL, EDGE, FILL, RING, CORE])
HALF_LINE = 2.0
"""Outlines reach this far to both sides of an edge."""
WALL_LINES = (5.0, 506.0)


class Pixels(NamedTuple):
    """Samples of a frame: places (n, 2) on the surface, colours (n, 3) seen there and those of an empty scene."""

    places: Array
    seen: Array
    empty: Array


def places() -> Array:
    """Where on the surface the samples of a frame lie: (96, 96, 2), x and y."""
    line = (np.arange(SIZE) + 0.5) * SCALE - 0.5
    return np.stack(np.meshgrid(line, line), -1)


def empty_scene(edges: Outline, goal: Array) -> Array:
    """Colours (96, 96, 3) of walls and goal (pose (3,) of the outline's frame) alone."""
    at = places()
    c, s = np.cos(goal[2]), np.sin(goal[2])
    body = (at - goal[:2]) @ np.array([[c, -s], [s, c]])
    inside = np.array([[clearance(edges, *p) <= 0.5 for p in row] for row in body])
    off = np.abs(at[..., None] - np.array(WALL_LINES)).min(axis=(2, 3))
    scene = np.where(inside[..., None], GOAL, WHITE)
    return np.where((off <= HALF_LINE)[..., None], WALL, scene)


@njit(cache=True, error_model="numpy")
def _ramp(depth: float, width: float) -> float:
    """How much of a sample is covered that lies `depth` inside: 0 to 1 over the width."""
    return min(max(depth / width + 0.5, 0.0), 1.0)


@njit(cache=True, error_model="numpy")
def paint(edges: Outline, last: int, pose: Array, pixels: Pixels, width: float, out: Array) -> None:
    """Colours (n, 3) of the scene with the block at a pose (3,); piece `last` is painted over the others."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    pieces = len(edges.first) - 1
    for i in range(len(out)):
        rx, ry = pixels.places[i, 0] - pose[0], pixels.places[i, 1] - pose[1]
        x, y = c * rx + s * ry, c * ry - s * rx
        for d in range(3):
            out[i, d] = pixels.empty[i, d]
        for k in range(pieces):
            gap = distance_up_to(edges, (last + 1 + k) % pieces, x, y, HALF_LINE + width)
            if gap < HALF_LINE + width:
                line, fill = _ramp(HALF_LINE - gap, width), _ramp(-HALF_LINE - gap, width)
                for d in range(3):
                    out[i, d] += line * (EDGE[d] - out[i, d])
                    out[i, d] += fill * (FILL[d] - out[i, d])


@njit(cache=True, error_model="numpy")
def paint_disc(radius: float, centre: Array, pixels: Pixels, width: float, out: Array) -> None:
    """Colours (n, 3) of the scene with the agent's disc at `centre`."""
    for i in range(len(out)):
        gap = np.hypot(pixels.places[i, 0] - centre[0], pixels.places[i, 1] - centre[1]) - radius
        ring, core = _ramp(-gap, width), _ramp(-2 * HALF_LINE - gap, width)
        for d in range(3):
            out[i, d] = pixels.empty[i, d]
            out[i, d] += ring * (RING[d] - out[i, d])
            out[i, d] += core * (CORE[d] - out[i, d])


def painted(
    edges: Outline, empty: Array, pose: Array, radius: float, agent: Array, width: float = 4.0
) -> NDArray[np.uint8]:
    """A frame (96, 96, 3) of the block at a pose (3,), over the agent's disc, over an empty scene (96, 96, 3)."""
    scene = empty.reshape(-1, 3)
    spots, out = places().reshape(-1, 2), np.empty_like(scene)
    paint_disc(radius, agent, Pixels(spots, scene, scene), width, out)
    below = out.copy()
    paint(edges, len(edges.first) - 2, pose, Pixels(spots, below, below), width, out)
    return np.rint(out).astype(np.uint8).reshape(empty.shape)
