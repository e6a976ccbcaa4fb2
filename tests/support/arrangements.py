"""Random arrangements for the cage verifier: escapes and cages, easy and narrow, in about equal parts."""

import numpy as np
import shapely

from expert.geometry.polygon import facet_frames, signed_distance
from expert.geometry.pose import Array, rotation, to_world
from expert.problems.cage import Arrangement
from expert.world.shape import Shape
from expert.world.walls import segments
from tests.support.polygons import hard_polygon, random_polygon

SIZE = 0.1


def random_arrangement(rng: np.random.Generator) -> Arrangement:
    """A random polygon among 2-7 fingers that are scattered, hug it, or fence it in, and sometimes walls."""
    return _among(rng, random_polygon(rng, int(rng.integers(3, 11)), size=SIZE))


def hard_arrangement(rng: np.random.Generator, family: str) -> Arrangement:
    """The same for a polygon of a hard family."""
    return _among(rng, SIZE * hard_polygon(rng, family))


def _among(rng: np.random.Generator, vertices: Array) -> Arrangement:
    count = int(rng.integers(2, 8))
    place = (_scattered, _hugging, _hugging, _fence)[rng.integers(4)]
    fingers = place(rng, vertices, count)
    walls = _walls(rng, vertices) if rng.random() < 0.3 else np.empty((0, 2, 2))
    pose = np.append(rng.uniform(-0.2, 0.2, 2), rng.uniform(-np.pi, np.pi))
    return Arrangement(
        shape=Shape(vertices=vertices),
        pose=pose,
        fingers=to_world(pose, fingers),
        walls=segments(to_world(pose, walls.reshape(-1, 2))),
    )


def _scattered(rng: np.random.Generator, vertices: Array, count: int) -> Array:
    fingers: list[Array] = []
    while len(fingers) < count:
        x = rng.uniform(-0.9, 0.9, 2) * SIZE
        if signed_distance(vertices, x) > 0:
            fingers.append(x)
    return np.array(fingers)


def _hugging(rng: np.random.Generator, vertices: Array, count: int) -> Array:
    """Near boundary points spread evenly along the perimeter, at clearances of one common scale."""
    edges = np.roll(vertices, -1, axis=0) - vertices
    lengths = np.linalg.norm(edges, axis=1)
    inward, _ = facet_frames(vertices)
    clearance = SIZE * 10.0 ** rng.uniform(-4, -0.8)
    along = (np.arange(count) + rng.uniform(0, 0.8, count)) / count * lengths.sum()
    fingers = []
    for s in along:
        k = int(min(np.searchsorted(np.cumsum(lengths), s), len(lengths) - 1))
        x = vertices[k] + rng.uniform(0.02, 0.98) * edges[k] - rng.random() * clearance * inward[k]
        if signed_distance(vertices, x) >= 0:
            fingers.append(x)
    return np.array(fingers) if len(fingers) >= 2 else _scattered(rng, vertices, count)


def _fence(rng: np.random.Generator, vertices: Array, count: int) -> Array:
    """On a circle about the object, wide or tight."""
    centre = np.array(shapely.minimum_bounding_circle(shapely.MultiPoint(vertices)).centroid.coords[0])
    radius = np.linalg.norm(vertices - centre, axis=1).max() * rng.uniform(0.7, 1.2)
    angles = 2 * np.pi * (np.arange(count) + rng.uniform(-0.2, 0.2, count)) / count + rng.uniform(
        0, 2 * np.pi
    )
    ring = centre + radius * np.column_stack([np.cos(angles), np.sin(angles)])
    outside = ring[signed_distance(vertices, ring) > 0]
    return outside if len(outside) >= 2 else _scattered(rng, vertices, count)


def _walls(rng: np.random.Generator, vertices: Array) -> Array:
    """Up to three segments that miss the object, some of them close to it."""
    polygon = shapely.Polygon(vertices)
    walls: list[Array] = []
    for _ in range(12):
        turn, length = rng.uniform(0, 2 * np.pi), SIZE * rng.uniform(0.2, 1.6)
        lowest = (vertices @ rotation(turn))[:, 1].min() - SIZE * 10.0 ** rng.uniform(-3, -0.5)
        middle = SIZE * rng.uniform(-0.4, 0.4)
        ends = np.array([[middle - length / 2, lowest], [middle + length / 2, lowest]]) @ rotation(turn).T
        if shapely.LineString(ends).distance(polygon) > 0:
            walls.append(ends)
    return np.array(walls[: rng.integers(1, 4)]).reshape(-1, 2, 2)


def transformed(a: Arrangement, rng: np.random.Generator) -> Arrangement:
    """The same arrangement mirrored half of the time, scaled, and moved rigidly, in this order."""
    turn, shift, scale = rng.uniform(-np.pi, np.pi), rng.uniform(-1, 1, 2), 10.0 ** rng.uniform(-2, 2)
    sign = 1.0 if rng.random() < 0.5 else -1.0
    mirror = np.diag([1.0, sign])

    def moved(points: Array) -> Array:
        return scale * points @ mirror @ rotation(turn).T + shift

    return Arrangement(
        shape=Shape(vertices=scale * a.shape.vertices @ mirror),
        pose=np.append(moved(a.pose[:2]), sign * a.pose[2] + turn),
        fingers=moved(a.fingers),
        walls=segments(moved(a.wall_ends)),
    )


def with_finger(a: Arrangement, rng: np.random.Generator) -> Arrangement:
    """One more finger, somewhere outside the object."""
    while True:
        x = a.pose[:2] + rng.uniform(-0.9, 0.9, 2) * SIZE
        polygon_w = to_world(a.pose, a.shape.vertices)
        if signed_distance(polygon_w, x) > 0:
            return Arrangement(shape=a.shape, pose=a.pose, fingers=np.vstack([a.fingers, x]), walls=a.walls)
