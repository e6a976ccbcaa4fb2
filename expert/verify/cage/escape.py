"""Exact check of an escape path, written apart from everything that finds one.

A path is a list of body poses.  Two neighbours with equal angles are joined by a translation, all others by the rotation
about the fixed point that takes one to the other.  Seen from the object, a finger then runs along a segment or an arc;
seen from a wall, so does a corner of the object.  A finger or wall that starts outside the object and whose ends, and
the object's corners, cross no boundary stays outside.  Nothing is sampled.
"""

import itertools

import numba
import numpy as np
import shapely

from expert.geometry.pose import Array, to_body, to_world
from expert.problems.cage import START_TOLERANCE, Arrangement

DEPTHS = (0.0, 1e-10, START_TOLERANCE)
"""The object may be entered by this fraction of its diameter: by nothing, if the path allows it, at most as at the start."""
BLUNTED = 1e-6
"""Corners of the object drawn in by a depth must stay within this fraction of its diameter: what is thinner would be missed."""
_TOUCH = 1e-13
"""Crossing tests call anything closer than this, relative to the lengths compared, a crossing."""


def escape_fault(arrangement: Arrangement, path: Array) -> str | None:
    """Why the path is no escape, or None if it is one.  path: body poses (K, 3), from the start pose on.

    The object may be entered by START_TOLERANCE of its diameter, as at the start pose, but only where that leaves its
    shape as it is: a needle thinner than this is no hole.
    """
    if len(path) < 1 or not np.isfinite(path).all():
        return "no poses"
    size = arrangement.shape.size
    if np.abs(path[0] - arrangement.pose).max() > 1e-9 * max(size, 1.0):
        return "it does not begin at the start pose"
    for k, (a, b) in enumerate(itertools.pairwise(path)):
        if abs(b[2] - a[2]) > 3.0:
            return f"move {k} turns by more than 3 rad"
    if not is_free_forever(arrangement, path[-1]):
        return "its end is still among the obstacles"
    fault: str | None = None
    for depth in DEPTHS:
        core = drawn_in(arrangement.shape.vertices, depth * size, BLUNTED * size)
        if core is None:
            return fault or "its parts are thinner than what can be checked"
        fault = _collision(arrangement, core, path)
        if fault is None:
            return None
    return fault


def drawn_in(vertices: Array, depth: float, most: float) -> shapely.Polygon | None:
    """A polygon drawn in by `depth`; None where this moves some corner by more than `most`, or cuts it into parts."""
    polygon = shapely.Polygon(vertices)
    if depth == 0:
        return polygon
    core = polygon.buffer(-depth, join_style="mitre")
    if core.geom_type != "Polygon" or core.is_empty:
        return None
    return core if shapely.distance(shapely.points(vertices), core).max() <= most else None


def _collision(arrangement: Arrangement, core: shapely.Polygon, path: Array) -> str | None:
    """Where a finger or wall meets the drawn-in object; None: nowhere."""
    if _overlap(arrangement, core, path[0]):
        return "it begins in collision"
    edges = core_edges(core)
    for k, (a, b) in enumerate(itertools.pairwise(path)):
        if move_collides(a, b, edges, arrangement.fingers, arrangement.wall_ends):
            return f"move {k} collides"
    return None


def core_edges(core: shapely.Geometry) -> Array:
    """All boundary edges (E, 2 ends, 2) of a polygon or several."""
    rings = [r for part in shapely.get_parts(core) for r in (part.exterior, *part.interiors)]
    points = [np.array(r.coords) for r in rings]
    return np.concatenate([np.stack([p[:-1], p[1:]], axis=1) for p in points])


def _overlap(arrangement: Arrangement, core: shapely.Geometry, pose: Array) -> bool:
    points = shapely.points(to_body(pose, arrangement.fingers))
    segments = [shapely.LineString(to_body(pose, ends)) for ends in arrangement.wall_ends]
    return bool(shapely.intersects(core, np.array([*points, *segments])).any())


def is_free_forever(arrangement: Arrangement, pose: Array) -> bool:
    """Whether a line separates the object from all obstacles: it can then be moved to infinity."""
    obstacles = np.concatenate([arrangement.fingers, arrangement.wall_ends.reshape(-1, 2)])
    body = shapely.MultiPoint(to_world(pose, arrangement.shape.vertices)).convex_hull
    return bool(body.disjoint(shapely.MultiPoint(obstacles).convex_hull))


@numba.njit(cache=True)
def move_collides(a: Array, b: Array, edges: Array, fingers: Array, walls: Array) -> bool:
    """Whether the move between two body poses lets a finger or wall cross an edge of the object (E, 2, 2)."""
    angle = b[2] - a[2]
    if angle == 0.0:
        pole = np.zeros(2)
    else:  # the fixed point of the displacement
        w = 0.5 / np.tan(0.5 * angle)
        pole = np.array([0.5 * (a[0] + b[0]) - w * (b[1] - a[1]), 0.5 * (a[1] + b[1]) + w * (b[0] - a[0])])
    c, s = np.cos(a[2]), np.sin(a[2])
    world = np.empty_like(edges)  # at the first pose
    for i in range(len(edges)):
        for j in range(2):
            x, y = edges[i, j, 0], edges[i, j, 1]
            world[i, j, 0], world[i, j, 1] = a[0] + c * x - s * y, a[1] + s * x + c * y
    step = b[:2] - a[:2]
    for k in range(len(fingers)):
        if _point_collides(fingers[k], -step, pole, -angle, world):
            return True
    for k in range(len(walls)):
        if _point_collides(walls[k, 0], -step, pole, -angle, world):
            return True
        if _point_collides(walls[k, 1], -step, pole, -angle, world):
            return True
        for i in range(len(world)):
            if _point_collides(world[i, 0], step, pole, angle, walls[k : k + 1]):
                return True
    return False


@numba.njit(cache=True)
def _point_collides(p: Array, step: Array, pole: Array, angle: float, segments: Array) -> bool:
    """Whether a point that is translated by `step` (angle 0) or turned about the pole meets a segment (E, 2, 2)."""
    for i in range(len(segments)):
        if angle == 0.0:
            if segments_meet(p, p + step, segments[i, 0], segments[i, 1]):
                return True
        elif arc_meets_segment(p, pole, angle, segments[i, 0], segments[i, 1]):
            return True
    return False


@numba.njit(cache=True)
def segments_meet(p: Array, q: Array, a: Array, b: Array) -> bool:
    """Whether closed segments p-q and a-b have a point in common; near misses count."""
    ux, uy, vx, vy = q[0] - p[0], q[1] - p[1], b[0] - a[0], b[1] - a[1]
    scale = max(abs(ux), abs(uy), abs(vx), abs(vy), abs(a[0] - p[0]), abs(a[1] - p[1]))
    slack = _TOUCH * scale
    for axis in range(2):  # apart along an axis
        if max(p[axis], q[axis]) < min(a[axis], b[axis]) - slack:
            return False
        if max(a[axis], b[axis]) < min(p[axis], q[axis]) - slack:
            return False
    area = slack * scale
    a_side = ux * (a[1] - p[1]) - uy * (a[0] - p[0])
    b_side = ux * (b[1] - p[1]) - uy * (b[0] - p[0])
    if (a_side > area and b_side > area) or (a_side < -area and b_side < -area):
        return False
    p_side = vx * (p[1] - a[1]) - vy * (p[0] - a[0])
    q_side = vx * (q[1] - a[1]) - vy * (q[0] - a[0])
    return not ((p_side > area and q_side > area) or (p_side < -area and q_side < -area))


@numba.njit(cache=True)
def arc_meets_segment(p: Array, pole: Array, angle: float, a: Array, b: Array) -> bool:
    """Whether p, turned about the pole from 0 to `angle`, meets the segment a-b; near misses count."""
    rx, ry = p[0] - pole[0], p[1] - pole[1]
    ax, ay, ex, ey = a[0] - pole[0], a[1] - pole[1], b[0] - a[0], b[1] - a[1]
    square, half, length = rx * rx + ry * ry, ax * ex + ay * ey, ex * ex + ey * ey
    discriminant = half * half - length * (ax * ax + ay * ay - square)
    slack = _TOUCH * (half * half + length * (ax * ax + ay * ay + square))
    if discriminant < -slack:
        return False
    root = np.sqrt(max(discriminant, 0.0))
    for sign in (-1.0, 1.0):
        t = (-half + sign * root) / length
        if -1e-9 <= t <= 1 + 1e-9:
            x, y = ax + t * ex, ay + t * ey
            turn = np.arctan2(rx * y - ry * x, rx * x + ry * y)
            if angle < 0:
                turn = -turn
            if turn < -1e-9:
                turn += 2 * np.pi
            if turn <= abs(angle) + 1e-9:
                return True
    return False
