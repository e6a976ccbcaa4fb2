"""Poses of an escape through the free components of cells: translate within a component, turn within its cell."""

import itertools
from collections import deque
from dataclasses import dataclass

import numpy as np
import shapely

from expert.geometry.pose import Array, wrapped


@dataclass(frozen=True)
class Leg:
    """A cell's orientations (first, last), a component free at all of them, and the positions shared with the next leg."""

    bounds: tuple[float, float]
    component: shapely.Polygon
    passage: shapely.Geometry | None


def escape_path(legs: list[Leg], box: shapely.Polygon) -> Array:
    """Relative configurations (K, 3) from the origin, through all legs, to the box's rim beyond all obstacles."""
    here, angle = np.zeros(2), 0.0
    poses = [(*here, angle)]
    for leg, following in zip(legs, [*legs[1:], None], strict=True):
        there = _way_out(leg, here, box) if following is None else _crossing(leg, here)
        poses += [(*x, angle) for x in _translation(leg.component, here, there)]
        here = there
        if following is not None:
            angle = _nearest(_common_angle(leg.bounds, following.bounds), angle)
            poses.append((*here, angle))
    steps = [poses[0], *(b for a, b in itertools.pairwise(poses) if a != b)]
    return np.array(_merge_turns(steps))


def _crossing(leg: Leg, here: Array) -> Array:
    """Stay where the passage contains this position, otherwise go to a point well inside it."""
    if shapely.contains_properly(leg.passage, shapely.Point(here)):
        return here
    largest = max(shapely.get_parts(leg.passage), key=lambda part: part.area)
    return np.array(largest.point_on_surface().coords[0])


def _way_out(leg: Leg, here: Array, box: shapely.Polygon) -> Array:
    rim = shapely.box(*(np.array(box.bounds) + 0.25 * np.array([1, 1, -1, -1]))).exterior
    return np.array(rim.interpolate(rim.project(shapely.Point(here))).coords[0])


def _common_angle(a: tuple[float, float], b: tuple[float, float]) -> float:
    """The orientation that neighbouring cells share, up to full turns."""
    pairs = [(x, y) for x in a for y in b]
    return min(pairs, key=lambda p: abs(wrapped(p[0] - p[1])))[0]


def _nearest(angle: float, reference: float) -> float:
    """The same orientation, full turns added, nearest to the reference."""
    return reference + float(wrapped(angle - reference))


def _translation(component: shapely.Polygon, here: Array, there: Array) -> list[Array]:
    """Corners of a path inside the component, through midpoints of triangulation edges, straightened."""
    if component.contains(shapely.LineString([here, there])):
        return [there]
    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(component))
    first, last = (int(shapely.distance(triangles, shapely.Point(x)).argmin()) for x in (here, there))
    doors = _doors(triangles)
    came_from: dict[int, int | None] = {first: None}
    queue = deque([first])
    while queue and last not in came_from:
        k = queue.popleft()
        for j in doors[k]:
            if j not in came_from:
                came_from[j] = k
                queue.append(j)
    corridor, k = [there], last
    while (before := came_from.get(k)) is not None:
        corridor.append(doors[before][k])
        k = before
    return _straightened(component, [here, *corridor[::-1]])


def _doors(triangles: np.ndarray) -> list[dict[int, Array]]:
    """For each triangle its neighbours and the midpoints of the shared edges."""
    owner: dict[tuple, int] = {}
    doors: list[dict[int, Array]] = [{} for _ in triangles]
    for k, triangle in enumerate(triangles):
        ring = list(triangle.exterior.coords)
        for a, b in itertools.pairwise(ring):
            edge = (min(a, b), max(a, b))
            if edge in owner:
                doors[k][owner[edge]] = doors[owner[edge]][k] = (np.array(a) + b) / 2
            owner[edge] = k
    return doors


def _straightened(component: shapely.Polygon, corners: list[Array]) -> list[Array]:
    """Leave out corners wherever the direct way keeps off the component's boundary."""
    kept, k = [], 0
    shapely.prepare(component)
    while k < len(corners) - 1:
        ways = range(len(corners) - 1, k + 1, -1)
        sees = (j for j in ways if component.contains_properly(shapely.LineString([corners[k], corners[j]])))
        k = next(sees, k + 1)
        kept.append(corners[k])
    return kept


def _merge_turns(poses: list[tuple[float, float, float]]) -> list[tuple[float, float, float]]:
    """Successive turns at one position become one, of at most 90 degrees."""
    merged = poses[:1]
    for pose in poses[1:]:
        same = len(merged) > 1 and merged[-1][:2] == merged[-2][:2] == pose[:2]
        if same and abs(pose[2] - merged[-2][2]) <= np.pi / 2 and _onward(merged[-2], merged[-1], pose):
            merged[-1] = pose
        else:
            merged.append(pose)
    return merged


def _onward(a: tuple[float, ...], b: tuple[float, ...], c: tuple[float, ...]) -> bool:
    return (b[2] - a[2]) * (c[2] - b[2]) > 0
