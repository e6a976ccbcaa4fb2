"""A grasp planned for its end alone: the baseline of Fig. 5-31.

Contacts are chosen for their quality in resisting wrenches, each finger then comes straight along its facet's normal, all
from the same distance.  Nothing is asked of the way there.
"""

from dataclasses import dataclass

import numpy as np
import shapely
from numba import njit

from expert.geometry.polygon import facet_frames, facets, mass_properties
from expert.geometry.pose import Array, to_body, to_world
from expert.world.shape import Shape

INSET, SPACING = 0.1, 0.06
"""Contacts keep this share of a facet from its ends, and are tried this far apart, over the object's diameter."""
FLAT = 1e-9
"""Four wrenches in one plane hold no ball."""


@dataclass(frozen=True, kw_only=True)
class Grasp:
    """points (4, 2) [m] and unit outward normals (4, 2), body frame.

    quality: radius of the largest ball of wrenches (torques over the radius of gyration) that unit forces can resist.
    """

    points: Array
    normals: Array
    quality: float

    def approach(self, pose: Array, distance: float) -> Array:
        """Straight finger paths (2, 4, 2) [m], world, from that distance [m] to the contacts at an object pose (3,)."""
        return to_world(pose, np.stack([self.points + distance * self.normals, self.points]))


def best_grasp(shape: Shape, distance: float) -> Grasp:
    """The frictionless 4-finger grasp of best quality among evenly spaced contacts that fingers reach from that distance.

    Ferrari and Canny's measure; positive exactly for first-order form closure.  Raises ValueError where there is none.
    """
    points, normals = _contacts(shape, distance)
    plate = mass_properties(shape.vertices)
    arm = (points - plate.centroid) / np.sqrt(plate.second_moment / plate.area)
    inward = -normals
    wrenches = np.column_stack([inward, arm[:, 0] * inward[:, 1] - arm[:, 1] * inward[:, 0]])
    chosen, quality = _best_four(np.ascontiguousarray(wrenches))
    if quality <= 0:
        raise ValueError("no four contacts on this object are in form closure")
    return Grasp(points=points[chosen], normals=normals[chosen], quality=quality)


def least_distance(shape: Shape, grasp: Grasp, pose: Array, starts: Array) -> float:
    """Distance [m] from which the fingers begin outside of the object at all start poses (M, 3), in steps of 1 % of size."""
    polygon = shapely.Polygon(shape.vertices).buffer(1e-6 * shape.size)
    for step in range(1, 200):
        fingers = grasp.approach(pose, 0.01 * step * shape.size)[0]
        if not any(shapely.contains_xy(polygon, to_body(start, fingers)).any() for start in starts):
            return 0.01 * step * shape.size
    raise ValueError("the starts surround the contacts")


def _contacts(shape: Shape, distance: float) -> tuple[Array, Array]:
    """Points on the facets, evenly spaced, that can be reached along the normal, and outward normals."""
    a, b = facets(shape.vertices)
    outward = -facet_frames(shape.vertices)[0]
    polygon = shapely.Polygon(shape.vertices).buffer(-1e-9 * shape.size)
    points, normals = [], []
    for k, length in enumerate(np.linalg.norm(b - a, axis=1)):
        count = max(2, round((1 - 2 * INSET) * length / (SPACING * shape.size)) + 1)
        for share in np.linspace(INSET, 1 - INSET, count):
            point = a[k] + share * (b[k] - a[k])
            way = shapely.LineString([point, point + distance * outward[k]])
            if not polygon.intersects(way):
                points.append(point)
                normals.append(outward[k])
    return np.array(points), np.array(normals)


@njit(cache=True, error_model="numpy")
def _best_four(w: np.ndarray) -> tuple[np.ndarray, float]:
    """Indices of the four wrenches (n, 3) whose tetrahedron holds the largest ball about the origin, and its radius."""
    best, chosen = 0.0, np.zeros(4, np.int64)
    n = len(w)
    for i in range(n):
        for j in range(i):
            for k in range(j):
                for l in range(k):
                    r = min(
                        _depth(w[i], w[j], w[k], w[l]),
                        _depth(w[i], w[j], w[l], w[k]),
                        _depth(w[i], w[k], w[l], w[j]),
                        _depth(w[j], w[k], w[l], w[i]),
                    )
                    if r > best:
                        best = r
                        chosen[0], chosen[1], chosen[2], chosen[3] = i, j, k, l
    return chosen, best


@njit(cache=True, error_model="numpy")
def _depth(a: np.ndarray, b: np.ndarray, c: np.ndarray, apex: np.ndarray) -> float:
    """Distance of the origin from the plane through a, b, c; negative unless it is on the side of the apex."""
    u0, u1, u2 = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    v0, v1, v2 = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    n0, n1, n2 = u1 * v2 - u2 * v1, u2 * v0 - u0 * v2, u0 * v1 - u1 * v0
    length = np.sqrt(n0 * n0 + n1 * n1 + n2 * n2)
    height = (apex[0] - a[0]) * n0 + (apex[1] - a[1]) * n1 + (apex[2] - a[2]) * n2
    if abs(height) <= FLAT * length:
        return -1.0
    origin = -(a[0] * n0 + a[1] * n1 + a[2] * n2)
    return origin / length if height > 0 else -origin / length
