"""Random and awkward simple polygons [m]: seeded ones, and strategies for property-based tests."""

import numpy as np
import shapely
from hypothesis import strategies as st

from expert.geometry.pose import Array

CAGED = ("T", "I", "M", "hourglass", "hooks")
"""Named shapes that cages are searched for."""
GRASPED = ("T", "hourglass", "I", "M", "bracket", "arrow")
"""Named shapes that are grasped."""
IRREGULARITY, SPIKINESS, RADIUS = 0.5, 0.3, 0.05

AWKWARD: dict[str, Array] = {
    name: np.array(points, dtype=float) * 0.01
    for name, points in {
        "T": [(-1, -5), (1, -5), (1, 1), (5, 1), (5, 3), (-5, 3), (-5, 1), (-1, 1)],
        "C": [(0, 0), (6, 0), (6, 2), (2, 2), (2, 4), (6, 4), (6, 6), (0, 6)],
        "L": [(0, 0), (4, 0), (4, 1), (1, 1), (1, 4), (0, 4)],
        "comb": [
            (0, 0),
            (7, 0),
            (7, 5),
            (6, 5),
            (6, 1),
            (4, 1),
            (4, 5),
            (3, 5),
            (3, 1),
            (1, 1),
            (1, 5),
            (0, 5),
        ],
        "spiral": [
            (0, 0),
            (7, 0),
            (7, 7),
            (2, 7),
            (2, 3),
            (4, 3),
            (4, 5),
            (5, 5),
            (5, 2),
            (1, 2),
            (1, 8),
            (0, 8),
        ],
        "hourglass": [(-4, -5), (4, -5), (0.2, 0), (4, 5), (-4, 5), (-0.2, 0)],
        "collinear vertices": [(0, 0), (2, 0), (4, 0), (4, 4), (2, 4), (0, 4), (0, 2)],
        "notch to the hull": [(0, 0), (6, 0), (6, 4), (4, 4), (3, 1), (2, 4), (0, 4)],
        "sliver": [(0, 0), (10, 0), (10, 0.01), (0, 0.02)],
    }.items()
}


@st.composite
def polygons(draw: st.DrawFn, least: int = 3, most: int = 9) -> Array:
    """Simple polygon (V, 2) [m], counter-clockwise, about 10 cm large and anywhere within a metre: star-shaped or awkward."""
    place = np.array([draw(st.floats(-1, 1)), draw(st.floats(-1, 1))])
    if most >= 12 or draw(st.integers(0, 3)) == 0:
        fitting = [v for v in AWKWARD.values() if least <= len(v)]
        if fitting and draw(st.booleans()):
            return place + draw(st.sampled_from(fitting))
    count = draw(st.integers(least, most))
    gaps = np.array([draw(st.floats(1.0, 2.0)) for _ in range(count)])
    angles = draw(st.floats(0, 2 * np.pi)) + 2 * np.pi * np.cumsum(gaps) / gaps.sum()
    radii = np.array([draw(st.floats(0.015, 0.06)) for _ in range(count)])
    return place + radii[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])


def points_around(vertices: Array, count: int, seed: int, room: float = 0.5) -> Array:
    """Uniform points (count, 2) in the polygon's bounding box, grown by `room` times its size on each side."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    grow = room * (high - low).max()
    return np.random.default_rng(seed).uniform(low - grow, high + grow, (count, 2))


def random_polygon(rng: np.random.Generator, facets: int, *, size: float = 0.1) -> Array:
    """Simple polygon (facets, 2) of about the given diameter [m], drawn until no corner or neck is needle-thin."""
    while True:
        steps = rng.dirichlet(np.full(facets, 3.0))
        angles = 2 * np.pi * np.cumsum(steps)
        radii = rng.uniform(0.35, 1.0, facets)
        v = radii[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
        polygon = shapely.Polygon(v)
        if steps.max() < 0.45 and polygon.is_valid and _thick(polygon, v):
            return size / 2 * v


def random_nonconvex_polygon(rng: np.random.Generator, facets: int, *, size: float = 0.1) -> Array:
    """A random polygon whose hull has at least 15 % more area: two fingers may find something to hold on to."""
    while True:
        v = random_polygon(rng, facets, size=size)
        if shapely.Polygon(v).area < 0.87 * shapely.MultiPoint(v).convex_hull.area:
            return v


def _thick(polygon: shapely.Polygon, v: Array) -> bool:
    """Corners of at least 20 degrees, edges of at least 0.15, and one piece when eroded by 0.05."""
    ahead, back = np.roll(v, -1, axis=0) - v, np.roll(v, 1, axis=0) - v
    lengths = np.linalg.norm(ahead, axis=1)
    cosines = (ahead * back).sum(axis=1) / (lengths * np.linalg.norm(back, axis=1))
    core = polygon.buffer(-0.05)
    return bool(
        lengths.min() > 0.15 and cosines.max() < np.cos(np.radians(20)) and core.geom_type == "Polygon"
    )


def irregular_polygon(
    rng: np.random.Generator,
    facets: int,
    *,
    irregularity: float = IRREGULARITY,
    spikiness: float = SPIKINESS,
    radius: float = RADIUS,
) -> Array:
    """Simple polygon (facets, 2) [m] about the origin, drawn until it has neither needles nor slivers.

    irregularity: largest relative deviation of the angles between corners.  spikiness: standard deviation of the corners'
    distances from the origin over `radius`, their mean.
    """
    while True:
        steps = 1 + rng.uniform(-irregularity, irregularity, facets)
        angles = rng.uniform(0, 2 * np.pi) + 2 * np.pi * np.cumsum(steps) / steps.sum()
        radii = np.clip(rng.normal(1, spikiness, facets), 0.2, 2)
        v = radius * radii[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
        if shapely.Polygon(v).is_valid and _sturdy(v, radius):
            return v


def _sturdy(v: Array, radius: float) -> bool:
    """Corners between 20 and 340 degrees that are not flat, and edges of at least a quarter of the radius."""
    ahead, back = np.roll(v, -1, axis=0) - v, np.roll(v, 1, axis=0) - v
    lengths = np.linalg.norm(ahead, axis=1)
    cosines = (ahead * back).sum(axis=1) / (lengths * np.linalg.norm(back, axis=1))
    sharp, flat = cosines.max() > np.cos(np.radians(20)), cosines.min() < np.cos(np.radians(172))
    return bool(lengths.min() > 0.25 * radius and not sharp and not flat)


def hard_polygon(rng: np.random.Generator, family: str) -> Array:
    """Simple polygon (V, 2) about 1 large, of a family that is hard to cage and to free: slivers, combs, gears, spirals, rings."""
    return {"sliver": _sliver, "comb": _comb, "gear": _gear, "spiral": _spiral, "ring": _ring}[family](rng)


HARD = ("sliver", "comb", "gear", "spiral", "ring")


def _sliver(rng: np.random.Generator) -> Array:
    """A rectangle or triangle of length 1 and thickness 0.1 to 0.001."""
    thickness = 10.0 ** rng.uniform(-3, -1)
    box = np.array([[0, 0], [1, 0], [1, thickness], [0, thickness]])
    return box if rng.random() < 0.5 else np.array([[0, 0], [1, 0], [rng.uniform(0, 1), thickness]])


def _comb(rng: np.random.Generator) -> Array:
    """Two to six teeth of random widths and gaps on a back."""
    edges = rng.uniform(0.5, 1.5, 2 * int(rng.integers(2, 7)) - 1)
    x = np.concatenate([[0.0], np.cumsum(edges)]) / edges.sum()
    back, depth = rng.uniform(0.05, 0.3), rng.uniform(0.2, 0.9)
    levels = back + depth * (np.arange(len(edges)) % 2 == 0)
    top = np.column_stack([np.repeat(x, 2)[1:-1], np.repeat(levels, 2)])
    return np.concatenate([[[0.0, 0.0], [1.0, 0.0]], top[::-1]])


def _gear(rng: np.random.Generator) -> Array:
    """Six to sixteen straight teeth."""
    teeth = int(rng.integers(6, 17))
    root, share = rng.uniform(0.6, 0.9), rng.uniform(0.3, 0.7)
    turns = (np.arange(teeth)[:, None] + np.array([0.0, share, share, 1.0])).ravel() / teeth
    radii = 0.5 * np.tile([1.0, 1.0, root, root], teeth)
    return radii[:, None] * np.column_stack([np.cos(2 * np.pi * turns), np.sin(2 * np.pi * turns)])


def _spiral(rng: np.random.Generator) -> Array:
    """A band of 0.8 to 2.5 turns that leaves a gap of its own width or more between them."""
    return spiral(rng.uniform(0.8, 2.5), share=rng.uniform(0.3, 0.6), corners=int(rng.integers(8, 15)))


def spiral(turns: float, *, share: float, corners: int) -> Array:
    """A band along r = 0.1 + 0.4 t / turns, t turns, that fills a share of the pitch; so many corners per turn and side."""
    t = np.linspace(0, turns, max(int(turns * corners), 3) + 1)
    pitch = 0.4 / turns
    along = np.column_stack([np.cos(2 * np.pi * t), np.sin(2 * np.pi * t)])
    inner, outer = (0.1 + pitch * t)[:, None] * along, (0.1 + pitch * (t + share))[:, None] * along
    return np.concatenate([outer, inner[::-1]])


def _ring(rng: np.random.Generator) -> Array:
    """An annulus with an opening of 10 to 90 degrees."""
    opening, inner = np.radians(rng.uniform(10, 90)), rng.uniform(0.5, 0.9)
    t = np.linspace(0, 2 * np.pi - opening, int(rng.integers(12, 25)))
    arc = 0.5 * np.column_stack([np.cos(t), np.sin(t)])
    return np.concatenate([arc, inner * arc[::-1]])


def regular_polygon(facets: int, radius: float) -> Array:
    """All facets alike."""
    turns = 2 * np.pi * (np.arange(facets) + 0.1) / facets
    return radius * np.column_stack([np.cos(turns), np.sin(turns)])
