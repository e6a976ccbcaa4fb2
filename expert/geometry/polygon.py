"""Simple polygons, vertices (V, 2) in counter-clockwise order; facet k runs from vertex k to vertex k + 1."""

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from expert.errors import InvalidProblem
from expert.geometry.pose import Array, cross, perpendicular

NDArrayBool = np.ndarray[tuple[int, ...], np.dtype[np.bool_]]
IntArray = np.ndarray[tuple[int, ...], np.dtype[np.int64]]


@dataclass(frozen=True)
class MassProperties:
    """Of a plate with unit density per area: area [m^2], centroid (2,) [m], second moment about it [m^4]."""

    area: float
    centroid: Array
    second_moment: float


def signed_area(vertices: Array) -> float:
    """Area [m^2], positive for counter-clockwise order."""
    return 0.5 * float(np.sum(cross(vertices, np.roll(vertices, -1, axis=0))))


def mass_properties(vertices: Array) -> MassProperties:
    """Green's theorem over the boundary, about the first vertex (loses no digits far from the origin)."""
    v = vertices - vertices[0]
    w = np.roll(v, -1, axis=0)
    c = cross(v, w)
    area = 0.5 * c.sum()
    centroid = ((v + w) * c[:, None]).sum(axis=0) / (6 * area)
    about_first = ((v * v + v * w + w * w).sum(axis=1) * c).sum() / 12
    return MassProperties(
        float(area), centroid + vertices[0], float(about_first - area * centroid @ centroid)
    )


def simple_polygon(vertices: object, *, field: str) -> Array:
    """Vertices as a checked, counter-clockwise (V, 2) array; a clockwise list is read backwards from its first vertex.

    Raises InvalidProblem, naming `field`, for wrong shapes, non-finite numbers, repeated vertices, crossing edges, no area.
    """
    try:
        v = np.array(vertices, dtype=float)
    except (TypeError, ValueError):
        v = np.empty(0)
    if v.ndim != 2 or v.shape[1] != 2 or len(v) < 3:
        raise InvalidProblem(
            field, expected="at least 3 points [x, y]", got=_shorten(vertices), remedy="list the corners"
        )
    if not np.isfinite(v).all():
        raise InvalidProblem(
            field, expected="finite numbers", got=_shorten(vertices), remedy="remove nan and inf"
        )
    size = float(np.ptp(v, axis=0).max())
    edges = np.linalg.norm(np.roll(v, -1, axis=0) - v, axis=1)
    if edges.min() <= 1e-9 * max(size, 1e-300):
        k = int(edges.argmin())
        raise InvalidProblem(
            field, expected="distinct neighbouring vertices", got=f"vertex {k} repeated", remedy="remove one"
        )
    if crossing := crossing_edges(v):
        i, j = crossing
        raise InvalidProblem(
            field,
            expected="a simple polygon",
            got=f"edges {i} and {j} that cross or touch",
            remedy="list the vertices in boundary order",
        )
    area = signed_area(v)
    if abs(area) <= 1e-9 * size**2:
        raise InvalidProblem(
            field, expected="a polygon with area", got=f"area {area:.3g} m^2", remedy="check units"
        )
    return v if area > 0 else np.concatenate([v[:1], v[:0:-1]])


def _shorten(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def crossing_edges(v: Array) -> tuple[int, int] | None:
    """First pair of edges that meet anywhere but in a shared vertex; None for a simple polygon.  Exact."""
    i, j = np.triu_indices(len(v), 1)
    doubtful = np.flatnonzero(~_clearly_apart(v, i, j))
    pairs = ((int(i[k]), int(j[k])) for k in doubtful)
    return next((pair for pair in pairs if _meet(v, *pair)), None)


def _clearly_apart(v: Array, i: IntArray, j: IntArray) -> NDArrayBool:
    """Which pairs of edges i < j have nothing but a shared vertex in common, whatever the rounding."""
    n = len(v)
    a, b, c, d = v[i], v[(i + 1) % n], v[j], v[(j + 1) % n]
    c_side, d_side, a_side, b_side = (
        _side_of(a, b, c),
        _side_of(a, b, d),
        _side_of(c, d, a),
        _side_of(c, d, b),
    )
    boxes_apart = (np.maximum(a, b) < np.minimum(c, d)).any(1) | (np.maximum(c, d) < np.minimum(a, b)).any(1)
    apart = boxes_apart | (c_side * d_side > 0) | (a_side * b_side > 0)
    turns_on = (d_side != 0) | (((a - b) * (d - b)).sum(1) < 0)
    turns_back = (b_side != 0) | (((b - a) * (c - a)).sum(1) < 0)
    neighbours, ends = j == i + 1, (i == 0) & (j == n - 1)
    return np.where(neighbours, turns_on, np.where(ends, turns_back, apart))


def _side_of(a: Array, b: Array, c: Array) -> IntArray:
    """1: c is left of the line from a to b, -1: right of it, 0: too close to tell in doubles (Shewchuk's bound)."""
    left = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1])
    right = (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    doubt = 4e-16 * (np.abs(left) + np.abs(right)) + 1e-300  # products may underflow
    return np.sign(np.where(np.abs(left - right) > doubt, left - right, 0)).astype(np.int64)


def _meet(v: Array, i: int, j: int) -> bool:
    """Whether edges i < j have more than a shared vertex in common, in rational numbers."""
    n = len(v)
    a, b, c, d = ([Fraction(float(x)) for x in v[k % n]] for k in (i, i + 1, j, j + 1))
    if j == i + 1:
        return _folds_back(a, b, d)
    if i == 0 and j == n - 1:
        return _folds_back(c, a, b)
    boxes = all(
        max(min(p, q), min(r, s)) <= min(max(p, q), max(r, s)) for p, q, r, s in zip(a, b, c, d, strict=True)
    )
    return boxes and _side(a, b, c) * _side(a, b, d) <= 0 and _side(c, d, a) * _side(c, d, b) <= 0


def _folds_back(a: list[Fraction], b: list[Fraction], c: list[Fraction]) -> bool:
    """Whether edge b-c runs along edge a-b."""
    return _side(a, b, c) == 0 and sum((x - y) * (z - y) for x, y, z in zip(a, b, c, strict=True)) > 0


def _side(a: list[Fraction], b: list[Fraction], c: list[Fraction]) -> Fraction:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def facets(vertices: Array) -> tuple[Array, Array]:
    """End points a, b of all facets, each (V, 2)."""
    return vertices, np.roll(vertices, -1, axis=0)


def facet_frames(vertices: Array) -> tuple[Array, Array]:
    """Unit inward normals n and tangents tau (from a to b) of all facets, each (V, 2)."""
    a, b = facets(vertices)
    tangent = (b - a) / np.linalg.norm(b - a, axis=1, keepdims=True)
    return perpendicular(tangent), tangent


def is_convex(vertices: Array) -> bool:
    """Whether no vertex is reflex (collinear neighbours are allowed)."""
    return not reflex_vertices(vertices).any()


def reflex_vertices(vertices: Array) -> NDArrayBool:
    """Mask (V,): interior angle above 180 degrees."""
    a, b = facets(vertices)
    e = b - a
    before = np.roll(e, 1, axis=0)
    scale = np.linalg.norm(e, axis=1) * np.linalg.norm(before, axis=1)
    return cross(before, e) < -1e-9 * scale


def diameter(vertices: Array) -> float:
    """Largest distance between two vertices [m]."""
    return float(np.max(np.linalg.norm(vertices[:, None] - vertices[None], axis=2)))


def signed_distance(vertices: Array, points: Array) -> Array:
    """Distance of points (..., 2) to the boundary [m], negative inside."""
    a, b = facets(vertices)
    x = np.asarray(points, dtype=float)[..., None, :]
    e = b - a
    s = np.clip(((x - a) * e).sum(-1) / (e * e).sum(-1), 0, 1)
    distance = np.linalg.norm(x - a - s[..., None] * e, axis=-1).min(-1)
    return np.where(contains(vertices, points), -distance, distance)


def contains(vertices: Array, points: Array) -> NDArrayBool:
    """Whether points (..., 2) lie inside, by crossing number; the boundary itself falls either way."""
    a, b = facets(vertices)
    x, y = (np.asarray(points, dtype=float)[..., None, i] for i in (0, 1))
    straddles = (a[:, 1] > y) != (b[:, 1] > y)
    rise = np.where(a[:, 1] == b[:, 1], 1.0, b[:, 1] - a[:, 1])
    return (straddles & (x < a[:, 0] + (y - a[:, 1]) * (b[:, 0] - a[:, 0]) / rise)).sum(-1) % 2 == 1
