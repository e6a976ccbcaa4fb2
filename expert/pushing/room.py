"""Where object and finger may be: half-planes and polygonal obstacles, and how far it is to the goal round them."""

from typing import NamedTuple

import numpy as np
from numba import njit

from expert.geometry.pose import Array
from expert.pushing.outline import Outline, clearance

NOTHING = Outline(
    np.zeros((0, 2)), np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0), np.zeros(1, dtype=np.int64)
)
"""No obstacles."""


class Field(NamedTuple):
    """Lengths (R, C) of the shortest ways of the object's centroid to the goal, at the nodes of a grid (inf: none).

    x, y: of the first node; cell: between nodes.  Without rows the way is straight.
    """

    lengths: Array
    x: float
    y: float
    cell: float


EVERYWHERE = Field(np.zeros((0, 0)), 0.0, 0.0, 1.0)


class Room(NamedTuple):
    """The object's hull (H, 2) stays inside half-planes (W, 3): n, n . p; the finger's centre, and its commands, inside others (F, 3).

    pieces: the object's, in its own frame.  The object keeps `gap` from obstacles, the finger's centre `finger_gap`.
    """

    hull: Array
    walls: Array
    finger_walls: Array
    pieces: Outline
    obstacles: Outline
    gap: float
    finger_gap: float
    field: Field


@njit(cache=True, error_model="numpy")
def inside(walls: Array, x: float, y: float, slack: float) -> bool:
    """Whether a point keeps to the free side of all half-planes, but for `slack`."""
    for w in range(len(walls)):  # noqa: SIM110  (compiled)
        if walls[w, 0] * x + walls[w, 1] * y < walls[w, 2] - slack:
            return False
    return True


@njit(cache=True, error_model="numpy")
def finger_fits(room: Room, x: float, y: float) -> bool:
    """Whether the finger's centre may be at (x, y)."""
    return inside(room.finger_walls, x, y, 0.0) and clearance(room.obstacles, x, y) >= room.finger_gap


@njit(cache=True, error_model="numpy")
def fits(room: Room, x: float, y: float, angle: float, slack: float) -> bool:
    """Whether the object does, at a pose; `slack`: how far its hull may reach into walls."""
    c, s = np.cos(angle), np.sin(angle)
    for k in range(len(room.hull)):
        hx, hy = room.hull[k]
        if not inside(room.walls, x + c * hx - s * hy, y + s * hx + c * hy, slack):
            return False
    for a in range(len(room.pieces.first) - 1):
        for b in range(len(room.obstacles.first) - 1):
            if not _apart(room, a, b, x, y, c, s):
                return False
    return True


@njit(cache=True, error_model="numpy")
def _apart(room: Room, piece: int, obstacle: int, x: float, y: float, c: float, s: float) -> bool:
    """Whether an edge of one of two convex polygons has all of the other beyond the gap (never true where they meet)."""
    ours, theirs = room.pieces, room.obstacles
    for e in range(ours.first[piece], ours.first[piece + 1]):
        nx, ny = (
            c * ours.normals[e, 0] - s * ours.normals[e, 1],
            s * ours.normals[e, 0] + c * ours.normals[e, 1],
        )
        px, py = (
            x + c * ours.starts[e, 0] - s * ours.starts[e, 1],
            y + s * ours.starts[e, 0] + c * ours.starts[e, 1],
        )
        least = np.inf
        for k in range(theirs.first[obstacle], theirs.first[obstacle + 1]):
            least = min(least, nx * (theirs.starts[k, 0] - px) + ny * (theirs.starts[k, 1] - py))
        if least >= room.gap:
            return True
    for e in range(theirs.first[obstacle], theirs.first[obstacle + 1]):
        nx, ny = theirs.normals[e]
        least = np.inf
        for k in range(ours.first[piece], ours.first[piece + 1]):
            px = x + c * ours.starts[k, 0] - s * ours.starts[k, 1] - theirs.starts[e, 0]
            py = y + s * ours.starts[k, 0] + c * ours.starts[k, 1] - theirs.starts[e, 1]
            least = min(least, nx * px + ny * py)
        if least >= room.gap:
            return True
    return False


@njit(cache=True, error_model="numpy")
def depth_in_walls(room: Room, pose: Array) -> float:
    """How far the hull reaches into walls at a pose; 0 outside of them."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    worst = 0.0
    for k in range(len(room.hull)):
        x = pose[0] + c * room.hull[k, 0] - s * room.hull[k, 1]
        y = pose[1] + s * room.hull[k, 0] + c * room.hull[k, 1]
        for w in range(len(room.walls)):
            worst = max(worst, room.walls[w, 2] - room.walls[w, 0] * x - room.walls[w, 1] * y)
    return worst


@njit(cache=True, error_model="numpy")
def way_round(field: Field, x: float, y: float) -> float:
    """Length of the centroid's way to the goal from the grid's node next to (x, y); 0 where there is no grid."""
    rows = len(field.lengths)
    if rows == 0:
        return 0.0
    columns = field.lengths.shape[1]
    row = min(max(round((y - field.y) / field.cell), 0), rows - 1)
    column = min(max(round((x - field.x) / field.cell), 0), columns - 1)
    return field.lengths[row, column]
