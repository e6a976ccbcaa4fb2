"""Shortest ways of the finger round the object: a visibility graph in the body frame, with distances to fixed stations."""

from typing import NamedTuple

import numpy as np
import shapely
from numba import njit
from scipy.sparse.csgraph import shortest_path

from expert.geometry.polygon import reflex_vertices, signed_area
from expert.geometry.pose import Array
from expert.world.shape import Shape
from expert.world.values import IntArray

INNER = 0.75
"""A way may not cut deeper than to this fraction of the disc's radius: a finger in contact must see its way off."""


class Roads(NamedTuple):
    """Edges (M, 2, 2) of the region that no way enters; corners (C, 2) at which ways bend; stations (S, 2).

    far[c, s]: length of the way from corner c to station s; hop[c, s]: the corner after c on it, -1: straight.
    """

    edges: Array
    corners: Array
    stations: Array
    far: Array
    hop: IntArray


def roads(shape: Shape, origin: Array, radius: float, gap: float, stations: Array) -> Roads:
    """Ways of a disc of `radius` about the shape, bending at `gap` from it; all points are relative to `origin`."""
    outline = shapely.Polygon(shape.vertices - origin)
    inner = _ring(outline, INNER * radius)
    outer = _ring(outline, radius + gap)
    corners = outer[~reflex_vertices(outer)]
    edges = np.stack([inner, np.roll(inner, -1, axis=0)], axis=1)
    count = len(corners)
    lengths = np.full((count, count), np.inf)
    for i in range(count):
        for j in range(count):
            if i != j and _visible(edges, *corners[i], *corners[j]):
                lengths[i, j] = np.linalg.norm(corners[i] - corners[j])
    between, before = shortest_path(np.where(np.isfinite(lengths), lengths, 0), return_predecessors=True)
    last = np.array([[_sight(edges, corner, station) for station in stations] for corner in corners])
    total = between[:, :, None] + last[None]  # from corner, by way of the last corner, to the station
    via = total.argmin(axis=1)
    hop = np.array([[_next(before, i, via[i, s]) for s in range(len(stations))] for i in range(count)])
    return Roads(edges, corners, np.ascontiguousarray(stations), total.min(axis=1), hop)


def _ring(outline: shapely.Polygon, offset: float) -> Array:
    grown = shapely.buffer(outline, offset, join_style="mitre", mitre_limit=2.0)
    ring = np.array(shapely.simplify(grown, 1e-9 * offset).exterior.coords)[:-1]
    return ring if signed_area(ring) > 0 else ring[::-1]


def _sight(edges: Array, a: Array, b: Array) -> float:
    return float(np.linalg.norm(a - b)) if _visible(edges, a[0], a[1], b[0], b[1]) else np.inf


def _next(before: IntArray, start: int, end: int) -> int:
    """The corner after `start` on the way to the corner `end`; -1 at `end` itself."""
    if start == end or before[start, end] < 0:
        return -1
    while before[start, end] != start:
        end = before[start, end]
    return int(end)


@njit(cache=True, error_model="numpy")
def _visible(edges: Array, ax: float, ay: float, bx: float, by: float) -> bool:
    """Whether the segment a-b crosses no edge."""
    dx, dy = bx - ax, by - ay
    for k in range(len(edges)):
        px, py = edges[k, 0, 0], edges[k, 0, 1]
        ex, ey = edges[k, 1, 0] - px, edges[k, 1, 1] - py
        side_p, side_q = dx * (py - ay) - dy * (px - ax), dx * (py + ey - ay) - dy * (px + ex - ax)
        if side_p * side_q < 0:
            side_a, side_b = ex * (ay - py) - ey * (ax - px), ex * (by - py) - ey * (bx - px)
            if side_a * side_b < 0:
                return False
    return True


@njit(cache=True, error_model="numpy")
def distances(ways: Roads, x: float, y: float, lengths: Array, first: IntArray) -> None:
    """Length of the way from (x, y) to each station, and its first corner (-1: straight); inf where there is none."""
    reach = np.empty(len(ways.corners))
    for c in range(len(ways.corners)):
        cx, cy = ways.corners[c, 0], ways.corners[c, 1]
        reach[c] = np.hypot(cx - x, cy - y) if _visible(ways.edges, x, y, cx, cy) else np.inf
    for s in range(len(ways.stations)):
        sx, sy = ways.stations[s, 0], ways.stations[s, 1]
        first[s] = -1
        if _visible(ways.edges, x, y, sx, sy):
            lengths[s] = np.hypot(sx - x, sy - y)
            continue
        lengths[s] = np.inf
        for c in range(len(ways.corners)):
            if reach[c] + ways.far[c, s] < lengths[s]:
                lengths[s], first[s] = reach[c] + ways.far[c, s], c


def bends(ways: Roads, point: Array, station: int) -> list[Array]:
    """Corners (2,) on the shortest way from a point (2,) to a station."""
    lengths, first = np.empty(len(ways.stations)), np.empty(len(ways.stations), np.int64)
    distances(ways, point[0], point[1], lengths, first)
    found, corner = [], int(first[station])
    while corner >= 0:
        found.append(ways.corners[corner])
        corner = int(ways.hop[corner, station])
    return found
