"""Named objects for cages [m] and seeded random polygons.  T, I, M and hourglass are those of Thesis 5.1.7."""

import numpy as np
import shapely

from expert.geometry.pose import Array

_UNIT = 0.01  # the drawings are in centimetres

_OUTLINES = {
    "T": [
        (-5.15, 4.65), (-5.15, 1.1), (-1.65, 1.1), (-1.65, -7.15),
        (1.65, -7.15), (1.65, 1.1), (5.15, 1.1), (5.15, 4.65),
    ],
    "I": [
        (-5.15, -5.15), (5.15, -5.15), (5.15, -2.85), (1.65, -2.85), (1.65, 2.85), (5.15, 2.85),
        (5.15, 5.15), (-5.15, 5.15), (-5.15, 2.85), (-1.65, 2.85), (-1.65, -2.85), (-5.15, -2.85),
    ],
    "M": [
        (-5.15, -5.15), (-2.15, -5.15), (-2.15, 2.0625728155339806), (0, -0.15), (2.15, 2.0625728155339806),
        (2.15, -5.15), (5.15, -5.15), (5.15, 5.15), (-5.15, 5.15),
    ],
    "hourglass": [(-5.3, -5.15), (5.3, -5.15), (0.15, 0), (5.3, 5.15), (-5.3, 5.15), (-0.15, 0)],
    # An S of two hooks that open in opposite directions.
    "hooks": [
        (-4, -5), (4, -5), (4, 1), (-2, 1), (-2, 3), (2, 3), (2, 2), (4, 2), (4, 5),
        (-4, 5), (-4, -1), (2, -1), (2, -3), (-2, -3), (-2, -2), (-4, -2),
    ],
}  # fmt: skip

NAMES = tuple(_OUTLINES)


def named_shape(name: str) -> Array:
    """Vertices (V, 2) [m] of a named object, counter-clockwise.  Raises KeyError for an unknown name."""
    return _UNIT * np.array(_OUTLINES[name], dtype=float)


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
