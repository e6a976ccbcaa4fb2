"""Random and awkward simple polygons for property-based tests."""

import numpy as np
from hypothesis import strategies as st

from expert.geometry.pose import Array

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
