"""Objects of the grasping experiments [m]: named ones and the seeded random polygons of Fig. 5-28."""

import numpy as np
import shapely

from expert.caging.shapes import named_shape
from expert.geometry.pose import Array

_EXTRA = {
    "bracket": [(-4, -5), (4, -5), (4, -2), (-1, -2), (-1, 5), (-4, 5)],
    "arrow": [(-4, -3), (0, -1), (4, -3), (0, 6)],
}  # centimetres

NAMES = ("T", "hourglass", "I", "M", "bracket", "arrow")
IRREGULARITY, SPIKINESS, RADIUS = 0.5, 0.3, 0.05


def grasp_shape(name: str) -> Array:
    """Vertices (V, 2) [m] of a named object, counter-clockwise.  Raises KeyError for an unknown name."""
    return 0.01 * np.array(_EXTRA[name], dtype=float) if name in _EXTRA else named_shape(name)


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
