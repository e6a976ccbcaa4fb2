"""Convex pieces of a polygon and convex regions of the free space around it."""

import itertools
from dataclasses import dataclass

import numpy as np
import shapely

from expert.geometry.polygon import facet_frames, facets, is_convex
from expert.geometry.pose import Array, cross


@dataclass(frozen=True)
class Region:
    """Convex set {x : A x <= b}.  A (h, 2) unit outward normals, b (h,) [m]."""

    A: Array
    b: Array

    @classmethod
    def of_polygon(cls, vertices: Array) -> "Region":
        """The convex polygon itself."""
        inward, _ = facet_frames(vertices)
        return cls(-inward, -(inward * vertices).sum(axis=1))


def convex_pieces(vertices: Array) -> list[Array]:
    """Partition into convex polygons: ear clipping, then merging over inessential diagonals (Hertel, Mehlhorn)."""
    if is_convex(vertices):
        return [vertices]
    pieces = [list(t) for t in _ear_clip(vertices)]
    merged = True
    while merged:
        merged = False
        for i, j in itertools.combinations(range(len(pieces)), 2):
            joined = _join(pieces[i], pieces[j], vertices)
            if joined is not None:
                pieces = [p for k, p in enumerate(pieces) if k not in (i, j)] + [joined]
                merged = True
                break
    return [vertices[p] for p in pieces]


def free_regions(vertices: Array, clearance: float = 0.0) -> list[Region]:
    """Convex regions that cover the outside of a polygon: beyond each facet of its hull, and its pockets.

    Their points keep `clearance` [m]: they cover the outside of the polygon's mitred offset.
    """
    hull = np.array(shapely.MultiPoint(vertices).convex_hull.exterior.coords)[:-1]
    hull = hull if cross(hull[1] - hull[0], hull[2] - hull[0]) > 0 else hull[::-1]
    inward, _ = facet_frames(hull)
    regions = [
        Region(n[None], np.array([n @ a - clearance])) for n, a in zip(inward, facets(hull)[0], strict=True)
    ]
    if not is_convex(vertices):
        for pocket in _pockets(*_grown(vertices, hull, clearance)):
            regions += [Region.of_polygon(piece) for piece in convex_pieces(pocket)]
    return regions


def _grown(vertices: Array, hull: Array, clearance: float) -> tuple[Array, Array]:
    """The mitred offset of a polygon and its hull, counter-clockwise."""
    if clearance == 0:
        return vertices, hull
    grown = shapely.Polygon(vertices).buffer(clearance, join_style="mitre", mitre_limit=1e3)
    outline = np.array(shapely.geometry.polygon.orient(grown).exterior.coords)[:-1]
    around = shapely.geometry.polygon.orient(shapely.MultiPoint(outline).convex_hull)
    return outline, np.array(around.exterior.coords)[:-1]


def _pockets(vertices: Array, hull: Array) -> list[Array]:
    """Polygons between the boundary and the hull, each a chain of vertices closed by a hull edge."""
    on_hull = (np.linalg.norm(vertices[:, None] - hull[None], axis=2) == 0).any(axis=1)
    corners = np.flatnonzero(on_hull)
    pockets = []
    for k, start in enumerate(corners):
        stop = corners[(k + 1) % len(corners)]
        chain = np.arange(start, stop + 1 if stop > start else stop + len(vertices) + 1) % len(vertices)
        pocket = vertices[chain][::-1]
        if len(chain) > 2 and shapely.Polygon(pocket).area > 1e-12 * shapely.Polygon(hull).area:
            pockets.append(pocket)
    return pockets


def _ear_clip(vertices: Array) -> list[tuple[int, ...]]:
    remaining, triangles = list(range(len(vertices))), []
    while len(remaining) > 3:
        k = max(range(len(remaining)), key=lambda k: _ear_quality(vertices, remaining, k))
        i, j, l = remaining[k - 1], remaining[k], remaining[(k + 1) % len(remaining)]
        if cross(vertices[j] - vertices[i], vertices[l] - vertices[i]) > 0:
            triangles.append((i, j, l))
        del remaining[k]
    return [*triangles, tuple(remaining)]


def _ear_quality(vertices: Array, remaining: list[int], k: int) -> float:
    """Height over base of the ear at position k; minus infinity where it is no ear."""
    i, j, l = (remaining[m % len(remaining)] for m in (k - 1, k, k + 1))
    a, b, c = vertices[[i, j, l]]
    twice_area = cross(b - a, c - a)
    if twice_area < 0:
        return -np.inf
    others = vertices[[m for m in remaining if m not in (i, j, l)]]
    inside = (
        (cross(b - a, others - a) >= 0) & (cross(c - b, others - b) >= 0) & (cross(a - c, others - c) >= 0)
    )
    return -np.inf if inside.any() else float(twice_area / max((e @ e) for e in (b - a, c - b, a - c)))


def _join(p: list[int], q: list[int], vertices: Array) -> list[int] | None:
    """Union of two pieces over a shared diagonal, if it is convex."""
    for k, i in enumerate(p):
        j = p[(k + 1) % len(p)]
        if i in q and q[(q.index(i) - 1) % len(q)] == j:
            m = q.index(i)
            joined = p[k + 1 :] + p[: k + 1] + [q[(m + s) % len(q)] for s in range(1, len(q) - 1)]
            return joined if is_convex(vertices[joined]) else None
    return None
