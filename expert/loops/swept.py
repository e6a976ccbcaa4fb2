"""Convex sets of the swept-Minkowski model, in relative lengths about the object at its start pose.

C_i     pieces of an overlapping convex cover of the object
D_ij    C_i + (-C_j): p - p' in R(t) D_ij iff the obstacles of pieces i of finger p and j of finger p' overlap
K_ij    intersection of R(t) D_ij over the whole range [L, U] of orientations, from inside
regions convex parts of the free plane around the object at its start pose
alpha   direction in which all of obstacle piece i lies, seen from the start, while its finger is in region r
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely

from expert.geometry.convex import Region, free_regions
from expert.geometry.cover import clip, half_planes, overlapping_cover
from expert.geometry.polygon import facet_frames, facets
from expert.geometry.pose import Array, cross, perpendicular, rotation

STEP = np.radians(2.5)
"""Largest part of a rotation range that is swept at once."""
FARTHEST = 4.0
"""Fingers stay within this distance (in enclosing radii) of the reference point, per coordinate."""
HalfPlanes = tuple[Array, Array]
"""A (h, 2) and b (h,) of {x : A x <= b}."""
BoolMatrix = np.ndarray[tuple[int, int], np.dtype[np.bool_]]


@dataclass(frozen=True)
class SweptGeometry:
    """Sets of one object.  vertices (V, 2) relative; clearance: relative distance that every condition keeps."""

    vertices: Array
    clearance: float
    most_pieces: int = 99

    @cached_property
    def pieces(self) -> list[Array]:
        """C_i, overlapping; where there are more than most_pieces, those that together cover most."""
        cover = [shapely.Polygon(p) for p in overlapping_cover(self.vertices)]
        chosen: list[shapely.Polygon] = []
        covered = shapely.Polygon()
        while cover and len(chosen) < self.most_pieces:
            best = max(cover, key=lambda p: p.difference(covered).area)
            chosen.append(best)
            cover.remove(best)
            covered = covered.union(best)
        return [np.array(p.exterior.coords)[:-1] for p in chosen]

    @cached_property
    def meeting(self) -> BoolMatrix:
        """Whether pieces i and j overlap with an area that survives erosion by the clearance."""
        n = len(self.pieces)
        eroded = [[self._shared(i, j, 0.0, 0.0, self.clearance) for j in range(n)] for i in range(n)]
        return np.array([[_has_area(polygon) for polygon in row] for row in eroded])

    @cached_property
    def _known(self) -> dict[tuple[float, ...], dict[tuple[int, int], HalfPlanes]]:
        """Sets by the range and clearance that they were asked for: models of one object ask again and again."""
        return {}

    def common(self, low: float, high: float, clearance: float) -> dict[tuple[int, int], HalfPlanes]:
        """Points in both of two pieces that meet at all angles in [low, high], as {x : A x <= b}; none: 0 <= -1."""
        key = low, high, clearance
        if key not in self._known:
            self._known[key] = self._common(*key)
        return self._known[key]

    def _common(self, low: float, high: float, clearance: float) -> dict[tuple[int, int], HalfPlanes]:
        sets = {}
        for i, j in zip(*np.nonzero(self.meeting), strict=True):
            shared = self._shared(i, j, low, high, clearance)
            nothing = np.zeros((1, 2)), np.array([-1.0])
            sets[int(i), int(j)] = half_planes(cleaned(shared)) if _has_area(shared) else nothing
        return sets

    def _shared(self, i: int, j: int, low: float, high: float, clearance: float) -> Array:
        overlap = clip(self.pieces[j], *half_planes(self.pieces[i]))
        return swept_inside(cleaned(overlap), low, high, clearance) if _has_area(overlap) else overlap[:0]

    @cached_property
    def differences(self) -> dict[tuple[int, int], Array]:
        """D_ij as convex polygons."""
        indices = range(len(self.pieces))
        return {(i, j): _minkowski(self.pieces[i], -self.pieces[j]) for i in indices for j in indices}

    def overlaps(self, low: float, high: float) -> dict[tuple[int, int], HalfPlanes]:
        """Non-empty K_ij over [low, high], eroded, as {x : A x <= b}."""
        if (low, high) not in self._known:
            swept = {
                key: swept_inside(polygon, low, high, self.clearance)
                for key, polygon in self.differences.items()
            }
            self._known[low, high] = {
                key: half_planes(_simplified(cleaned(polygon)))
                for key, polygon in swept.items()
                if _has_area(polygon)
            }
        return self._known[low, high]

    @cached_property
    def regions(self) -> list[Region]:
        """Convex regions in which fingers find room beside the object."""
        square = FARTHEST * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
        found = free_regions(self.vertices)
        inner = [self.cleared(region, self.clearance) for region in found]
        return [r for r, c in zip(found, inner, strict=True) if _has_area(clip(square, c.A, c.b))]

    def cleared(self, region: Region, clearance: float) -> Region:
        """A free region without the strip along the object's facets that the clearance takes."""
        inward, _ = facet_frames(self.vertices)
        offsets = (inward * facets(self.vertices)[0]).sum(axis=1)
        same = (np.abs(region.A[:, None] - inward[None]).max(axis=2) < 1e-9) & (
            np.abs(region.b[:, None] - offsets[None]) < 1e-9
        )
        return Region(region.A, region.b - clearance * same.any(axis=1))

    @cached_property
    def directions(self) -> Array:
        """alpha[r, i] [rad]: while p is in region r, u . (p - c) > 0 for all c in C_i, with u at angle alpha.

        Along pieces that meet, neighbouring angles differ by less than pi: the object is simply connected and the
        finger outside it, so that such angles exist.
        """
        square = FARTHEST * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
        rows = []
        for region in self.regions:
            corners = clip(square, region.A, region.b)
            normals = [_separating(corners, piece) for piece in self.pieces]
            rows.append(self._lifted(np.array([np.arctan2(n[1], n[0]) for n in normals])))
        return np.array(rows)

    def _lifted(self, angles: Array) -> Array:
        """Full turns added so that pieces that meet have neighbouring angles."""
        lifted, known = angles.copy(), {0}
        frontier = [0]
        while frontier:
            i = frontier.pop()
            for j in set(np.flatnonzero(self._touching[i]).tolist()) - known:
                lifted[j] += 2 * np.pi * np.round((lifted[i] - lifted[j]) / (2 * np.pi))
                known.add(j)
                frontier.append(j)
        return lifted

    @cached_property
    def _touching(self) -> BoolMatrix:
        polygons = np.array([shapely.Polygon(p) for p in self.pieces])
        return shapely.area(shapely.intersection(polygons[:, None], polygons[None])) > 1e-9


def swept_steps(low: float, high: float) -> list[tuple[float, float]]:
    """(middle, half-width) of equal parts of [low, high], none wider than STEP."""
    count = max(1, int(np.ceil((high - low) / STEP - 1e-9)))
    half = (high - low) / (2 * count)
    return [(low + (2 * k + 1) * half, half) for k in range(count)]


def swept_inside(polygon: Array, low: float, high: float, clearance: float) -> Array:
    """Convex polygon inside R(t) polygon for all t in [low, high], eroded.

    {y : n . y <= d} holds while it turns by up to h either way if it holds turned by +-h and, for d > 0, with the chord
    d cos h of the arc of tangent points in the middle.
    """
    normals, offsets = half_planes(polygon)
    offsets = offsets - clearance
    bulging = offsets > 0
    rows, bounds = [], []
    for middle, half in swept_steps(low, high):
        c, s = np.cos([middle - half, middle + half, middle]), np.sin([middle - half, middle + half, middle])
        turned = c[:, None, None] * normals + s[:, None, None] * perpendicular(normals)
        rows += [turned[0], turned[1], turned[2, bulging]]
        bounds += [offsets, offsets, offsets[bulging] * np.cos(half)]
    return clip(polygon @ rotation(low).T, np.concatenate(rows), np.concatenate(bounds))


def _minkowski(a: Array, b: Array) -> Array:
    sums = (a[:, None] + b[None]).reshape(-1, 2)
    hull = shapely.geometry.polygon.orient(shapely.MultiPoint(sums).convex_hull)
    return np.array(hull.exterior.coords)[:-1]


def _separating(free: Array, piece: Array) -> Array:
    """Unit normal u with the widest gap min u . free - max u . piece; an edge normal of one of the two polygons."""
    if not _has_area(free):
        return half_planes(piece)[0][0]  # no finger can be there: any direction will do
    candidates = np.concatenate([-half_planes(cleaned(free))[0], half_planes(piece)[0]])
    gaps = (free @ candidates.T).min(axis=0) - (piece @ candidates.T).max(axis=0)
    return candidates[int(gaps.argmax())]


def _has_area(polygon: Array) -> bool:
    return len(polygon) >= 3 and shapely.Polygon(polygon).area > 1e-9


def cleaned(polygon: Array) -> Array:
    """Without corners closer than 1e-7 to the next and without straight ones."""
    ahead = np.roll(polygon, -1, axis=0) - polygon
    return polygon[np.linalg.norm(ahead, axis=1) > 1e-7]


def _simplified(polygon: Array, share: float = 0.01) -> Array:
    """Convex polygon inside, with as few corners as cost at most this share of the area each."""
    area = shapely.Polygon(polygon).area
    while len(polygon) > 4:
        before, after = np.roll(polygon, 1, axis=0), np.roll(polygon, -1, axis=0)
        ears = 0.5 * cross(polygon - before, after - before)
        k = int(ears.argmin())
        if ears[k] > share * area:
            break
        polygon = np.delete(polygon, k, axis=0)
    return polygon
