"""Convex parts of the object, believed only where they are shown to lie inside it.

The cover that is given is a proposal: the code that makes it also serves those who place fingers, and a fault in it must
not fool both.  A part counts as {y : n_k . y <= d_k} over its edges, wherever its corners are.  Drawn in by TOLERANCE that
set is inside the object if no edge of the object enters it and one of its points is inside: a connected set that meets
no boundary is inside or outside as a whole.
"""

from collections.abc import Sequence

import numpy as np

from expert.geometry.cover import half_planes
from expert.geometry.polygon import contains, facets
from expert.geometry.pose import Array

TOLERANCE = 1e-9
"""Relative length by which a part may reach outside; the erosion of inner shapes includes it many times."""


def inside_parts(vertices: Array, parts: Sequence[Array]) -> list[Array]:
    """Those of some convex polygons (v, 2) that lie inside a simple one (V, 2)."""
    return [part for part in parts if is_inside(vertices, part)]


def is_inside(vertices: Array, part: Array) -> bool:
    """Whether the intersection of a polygon's half-planes, drawn in by TOLERANCE, is inside a simple polygon."""
    if (part == np.roll(part, 1, axis=0)).all(axis=1).any():
        return False  # an edge without direction
    normals, offsets = half_planes(part)
    offsets = offsets - TOLERANCE
    middle = part.mean(axis=0)
    if not (normals @ middle <= offsets).all() or not contains(vertices, middle):
        return False
    a, b = facets(vertices)
    beyond_a, beyond_b = a @ normals.T - offsets, b @ normals.T - offsets
    slope = beyond_b - beyond_a
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = -beyond_a / slope
    enter = np.where(slope < 0, crossing, 0.0).max(axis=1, initial=0.0)
    leave = np.where(slope > 0, crossing, 1.0).min(axis=1, initial=1.0)
    missed = ((slope == 0) & (beyond_a > 0)).any(axis=1)
    return bool((missed | (enter >= leave)).all())
