"""Exact pixel coverage of polygons and its derivative with respect to the vertices.

Pixel coordinates here are (X, Y) with Y upwards: pixel [j, i] of an image is the square [i, i + 1] x [j, j + 1].
"""

import numba
import numpy as np

from expert.geometry.polygon import crossing_edges
from expert.geometry.pose import Array, cross


@numba.njit(cache=True)
def coverage(vertices: Array, origins: Array, height: int, width: int) -> tuple[Array, Array]:
    """Share of each pixel that polygons cover, and its gradient.

    vertices: (T, V, 2) [pixels], counter-clockwise.  origins: (T, 2), lower left corner of each frame's window.
    Returns (T, height, width) and (T, height, width, V, 2).  By Green's theorem a pixel's share is the area between the
    outline's pieces in its row and its right side; moving a piece outwards adds its length times the movement.
    """
    frames, count = vertices.shape[:2]
    share = np.zeros((frames, height, width + 1))
    gradient = np.zeros((frames, height, width, count, 2))
    for t in range(frames):
        for k in range(count):
            following = k + 1 if k + 1 < count else 0
            start = vertices[t, k] - origins[t]
            end = vertices[t, following] - origins[t]
            _add_edge(start, end, k, following, share[t], gradient[t])
        for j in range(height):
            for i in range(1, width):
                share[t, j, i] += share[t, j, i - 1]
    return share[:, :, :width], gradient


@numba.njit(cache=True)
def _add_edge(start: Array, end: Array, k: int, following: int, share: Array, gradient: Array) -> None:
    """Walk along an edge from grid line to grid line; each piece lies in one pixel."""
    height, width = gradient.shape[:2]
    ex, ey = end[0] - start[0], end[1] - start[1]
    next_x, stride_x = _crossings(start[0], ex)
    next_y, stride_y = _crossings(start[1], ey)
    s = 0.0
    while s < 1.0:
        until = min(next_x, next_y, 1.0)
        if next_x <= until:
            next_x += stride_x
        if next_y <= until:
            next_y += stride_y
        piece, middle = until - s, 0.5 * (s + until)
        s = until
        x, y = start[0] + middle * ex, start[1] + middle * ey
        i, j = int(np.floor(x)), int(np.floor(y))
        if piece <= 0.0 or j < 0 or j >= height or i >= width:
            continue
        # The running sum along a row turns these two into the area to the right of the piece.
        inside = min(max(i + 1.0 - x, 0.0), 1.0) if i >= 0 else 1.0
        column = max(i, 0)
        share[j, column] -= piece * ey * inside
        share[j, column + 1] -= piece * ey * (1.0 - inside)
        if i >= 0:
            gradient[j, i, k, 0] += piece * (1.0 - middle) * ey
            gradient[j, i, k, 1] -= piece * (1.0 - middle) * ex
            gradient[j, i, following, 0] += piece * middle * ey
            gradient[j, i, following, 1] -= piece * middle * ex


@numba.njit(cache=True)
def _crossings(start: float, extent: float) -> tuple[float, float]:
    """Edge parameter of the first grid line that is crossed, and the distance to the next."""
    if extent > 0:
        return (np.floor(start) + 1.0 - start) / extent, 1.0 / extent
    if extent < 0:
        return (start - np.ceil(start) + 1.0) / -extent, -1.0 / extent
    return np.inf, np.inf


SHARPEST = 0.3
"""Corners are wider than this [rad]."""


def is_simple(vertices: Array) -> bool:
    """Whether no two edges of a polygon (V, 2) meet, and none folds back on the one before."""
    edges = np.roll(vertices, -1, axis=0) - vertices
    back, along = -edges, np.roll(edges, -1, axis=0)
    wide = np.arctan2(np.abs(cross(back, along)), (back * along).sum(axis=1)) >= SHARPEST
    return bool(wide.all()) and crossing_edges(vertices) is None
