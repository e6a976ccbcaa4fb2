"""Convex sets inside a polygon: half-plane clipping and covers whose pieces overlap across every seam."""

import numba
import numpy as np
import shapely

from expert.geometry.convex import convex_pieces
from expert.geometry.polygon import facet_frames
from expert.geometry.pose import Array

ROUNDING = 1e-12


@numba.njit(cache=True)
def clip(polygon: Array, normals: Array, offsets: Array, tolerance: float = 0.0) -> Array:
    """Convex polygon (v, 2) cut to {x : n . x <= d} for all rows of normals (k, 2), offsets (k,); possibly empty.

    Corners that exceed d by at most `tolerance` stay as they are.
    """
    kept = polygon
    for k in range(len(offsets)):
        gap = kept[:, 0] * normals[k, 0] + kept[:, 1] * normals[k, 1] - offsets[k]
        count, n = 0, len(kept)
        cut = np.empty((2 * n, 2))  # each edge adds at most its first corner and a crossing
        for i in range(n):
            j = i + 1 if i + 1 < n else 0
            if gap[i] <= tolerance:
                cut[count] = kept[i]
                count += 1
            if (gap[i] < -tolerance and gap[j] > tolerance) or (gap[i] > tolerance and gap[j] < -tolerance):
                cut[count] = kept[i] + gap[i] / (gap[i] - gap[j]) * (kept[j] - kept[i])
                count += 1
        kept = cut[:count]
        if count == 0:
            break
    return kept


def half_planes(convex: Array) -> tuple[Array, Array]:
    """Unit outward normals (v, 2) and offsets (v,) of a counter-clockwise convex polygon's facets."""
    inward, _ = facet_frames(convex)
    return -inward, -(inward * convex).sum(axis=1)


def overlapping_cover(vertices: Array) -> list[Array]:
    """Convex polygons (v, 2) inside a simple polygon that cover it and overlap along every seam of its partition.

    Each part of the convex partition is grown through each of its diagonals in turn: relaxing only the diagonal's own
    half-plane, the neighbour's share is convex, meets the part along the whole diagonal, and turns no corner reflex.
    """
    parts = convex_pieces(vertices)
    grown = []
    for k, part in enumerate(parts):
        doors = [
            (edge, other)
            for j, other in enumerate(parts)
            if j != k and (edge := _shared_edge(part, other)) is not None
        ]
        rotations = [doors[i:] + doors[:i] for i in range(len(doors))] or [[]]
        grown += [_grow(part, order) for order in rotations]
    return _maximal(grown)


def _maximal(pieces: list[Array]) -> list[Array]:
    """Without the pieces that lie inside others."""
    polygons = sorted((shapely.Polygon(p) for p in pieces), key=lambda p: -p.area)
    kept: list[shapely.Polygon] = []
    for polygon in polygons:
        if not any(larger.covers(polygon) for larger in kept):
            kept.append(polygon)
    return [np.array(p.exterior.coords)[:-1] for p in kept]


def _shared_edge(part: Array, other: Array) -> tuple[Array, Array] | None:
    """The diagonal from a to b that is an edge of `part` and, backwards, of `other`."""
    for a, b in zip(part, np.roll(part, -1, axis=0), strict=True):
        for c, d in zip(other, np.roll(other, -1, axis=0), strict=True):
            if (a == d).all() and (b == c).all():
                return a, b
    return None


def _grow(part: Array, doors: list[tuple[tuple[Array, Array], Array]]) -> Array:
    for (a, b), neighbour in doors:
        i = np.flatnonzero((part == a).all(axis=1))
        if not len(i) or not (part[(i[0] + 1) % len(part)] == b).all():
            continue  # an earlier step moved this edge
        opened = np.roll(part, -i[0] - 1, axis=0)  # from b round to a; the edge a-b closes it
        normals, offsets = half_planes(opened)
        lobe = clip(neighbour, normals[:-1], offsets[:-1], ROUNDING * float(np.abs(part).max()))
        part = _spliced(opened, lobe, a, b)
    return part


def _spliced(opened: Array, lobe: Array, a: Array, b: Array) -> Array:
    """Part (from b round to a) with the lobe's boundary from a to b in place of the edge a-b."""
    at_a = np.flatnonzero((lobe == a).all(axis=1))
    at_b = np.flatnonzero((lobe == b).all(axis=1))
    if not len(at_a) or not len(at_b) or len(lobe) < 3:
        return opened
    lobe = np.roll(
        lobe, -at_a[0], axis=0
    )  # starts at a; b is its last corner, since b -> a is the shared edge
    stop = int(np.flatnonzero((lobe == b).all(axis=1))[-1])
    return np.concatenate([opened, lobe[1:stop]])
