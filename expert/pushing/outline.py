"""The outline that a finger's disc touches: convex pieces, packed for compiled code, and the disc's distance to each."""

from typing import NamedTuple

import numpy as np
from numba import njit

from expert.geometry.polygon import facet_frames
from expert.geometry.pose import Array
from expert.world.shape import Shape
from expert.world.values import IntArray


class Outline(NamedTuple):
    """Edges of all pieces, one after the other: start points, unit outward normals and tangents (E, 2), lengths (E,).

    Piece k owns the edges first[k] ... first[k + 1] - 1; its points are relative to the origin of the moving frame.
    """

    starts: Array
    normals: Array
    tangents: Array
    lengths: Array
    first: IntArray


class Touch(NamedTuple):
    """Signed distance from a piece to a point, unit normal from the point into the piece, nearest point of the boundary."""

    distance: float
    nx: float
    ny: float
    x: float
    y: float


def outline(shape: Shape, origin: Array) -> Outline:
    """Pieces of a shape about `origin` (2,), a point of the shape's frame."""
    pieces = [np.asarray(piece) - origin for piece in shape.pieces]
    inward, tangents = zip(*(facet_frames(piece) for piece in pieces), strict=True)
    lengths = [np.linalg.norm(np.roll(piece, -1, axis=0) - piece, axis=1) for piece in pieces]
    first = np.cumsum([0, *(len(piece) for piece in pieces)])
    return Outline(
        np.concatenate(pieces),
        -np.concatenate(inward),
        np.concatenate(tangents),
        np.concatenate(lengths),
        first,
    )


@njit(cache=True, error_model="numpy")
def touch(edges: Outline, piece: int, x: float, y: float) -> Touch:
    """How the point (x, y) of the body frame lies to one convex piece."""
    deepest, at = -np.inf, 0
    for e in range(edges.first[piece], edges.first[piece + 1]):
        gap = (x - edges.starts[e, 0]) * edges.normals[e, 0] + (y - edges.starts[e, 1]) * edges.normals[e, 1]
        if gap > deepest:
            deepest, at = gap, e
    if deepest <= 0:
        nx, ny = -edges.normals[at, 0], -edges.normals[at, 1]
        return Touch(deepest, nx, ny, x + deepest * nx, y + deepest * ny)
    return _outside(edges, piece, x, y)


@njit(cache=True, error_model="numpy")
def _outside(edges: Outline, piece: int, x: float, y: float) -> Touch:
    least, px, py = np.inf, 0.0, 0.0
    for e in range(edges.first[piece], edges.first[piece + 1]):
        ax, ay = edges.starts[e, 0], edges.starts[e, 1]
        tx, ty = edges.tangents[e, 0], edges.tangents[e, 1]
        s = min(max((x - ax) * tx + (y - ay) * ty, 0.0), edges.lengths[e])
        qx, qy = ax + s * tx, ay + s * ty
        squared = (x - qx) ** 2 + (y - qy) ** 2
        if squared < least:
            least, px, py = squared, qx, qy
    distance = np.sqrt(least)
    return Touch(distance, (px - x) / distance, (py - y) / distance, px, py)


@njit(cache=True, error_model="numpy")
def distance_up_to(edges: Outline, piece: int, x: float, y: float, limit: float) -> float:
    """Signed distance from one convex piece to the point (x, y) of the body frame, or `limit` where it is at least that."""
    deepest = -np.inf
    for e in range(edges.first[piece], edges.first[piece + 1]):
        gap = (x - edges.starts[e, 0]) * edges.normals[e, 0] + (y - edges.starts[e, 1]) * edges.normals[e, 1]
        deepest = max(deepest, gap)
    if deepest <= 0 or deepest >= limit:
        return min(deepest, limit)
    return min(_outside(edges, piece, x, y).distance, limit)


@njit(cache=True, error_model="numpy")
def clearance(edges: Outline, x: float, y: float) -> float:
    """Signed distance of the point (x, y) of the body frame to the union of the pieces (inside: to the deepest piece)."""
    least = np.inf
    for piece in range(len(edges.first) - 1):
        least = min(least, touch(edges, piece, x, y).distance)
    return least
