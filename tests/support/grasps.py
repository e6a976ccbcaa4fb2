"""Finger paths for tests: random ones whose cages shrink about a form-closed end, and random ones that just close in."""

import numpy as np
from scipy.optimize import linprog

from expert.geometry.polygon import facet_frames
from expert.geometry.pose import Array, cross, rotation, to_world
from expert.problems.grasp import GraspProblem
from expert.world.named import named_shape
from expert.world.shape import Shape
from tests.support.polygons import random_polygon

WIDE = np.radians([45, 30, 15, 8, 2])
SHRINKING = np.array([1, 0.75, 0.5, 0.25, 0])


def end_contacts(vertices: Array, rng: np.random.Generator) -> tuple[Array, np.ndarray]:
    """Points (4, 2) on facets (4,) that hold the object firmly: forces of at least 3 % each can balance."""
    size = float(np.ptp(vertices, axis=0).max())
    inward, _ = facet_frames(vertices)
    while True:
        facets = rng.choice(len(vertices), 4)
        ahead = np.roll(vertices, -1, axis=0) - vertices
        points = vertices[facets] + rng.uniform(0.1, 0.9, (4, 1)) * ahead[facets]
        moments = cross(points - points.mean(axis=0), inward[facets]) / size
        balance = np.vstack([inward[facets].T, moments, np.ones(4)])
        if linprog(np.zeros(4), A_eq=balance, b_eq=[0, 0, 0, 1], bounds=[(0.03, None)] * 4).status == 0:
            return points, facets


def shrinking_path(vertices: Array, rng: np.random.Generator, *, opening: float = 0.06) -> Array:
    """Knots (5, 4, 2) that approach such contacts from up to `opening` times the size away, each in its own direction."""
    points, facets = end_contacts(vertices, rng)
    inward, tangents = facet_frames(vertices)
    away = -inward[facets] * rng.uniform(0.3, 1, (4, 1)) + tangents[facets] * rng.uniform(-1.5, 1.5, (4, 1))
    size = float(np.ptp(vertices, axis=0).max())
    return points + SHRINKING[:, None, None] * opening * size * away


def closing_in(vertices: Array, rng: np.random.Generator, fingers: int) -> Array:
    """Knots (3, fingers, 2) on random rings around the object that end inside it."""
    angles = np.sort(rng.uniform(0, 2 * np.pi, fingers))
    size = float(np.ptp(vertices, axis=0).max())
    ring = size * np.column_stack([np.cos(angles), np.sin(angles)])
    return np.stack([ring * r + size * rng.uniform(-0.1, 0.1, (fingers, 2)) for r in (0.75, 0.5, 0.25)])


def some_shape(rng: np.random.Generator, k: int) -> Array:
    """Every third one a named shape, the others random polygons."""
    if k % 3 == 0:
        return named_shape(("T", "hourglass", "M", "I")[k // 3 % 4])
    return random_polygon(rng, int(rng.integers(4, 8)))


def shrinking_case(seed: int, half_ranges: Array = WIDE) -> tuple[GraspProblem, Array]:
    """A problem with these half-ranges [rad], and a path whose cages shrink, nested or not."""
    rng = np.random.default_rng(seed)
    vertices = some_shape(rng, seed)
    return problem_of(vertices, half_ranges=half_ranges), shrinking_path(vertices, rng)


def problem_of(vertices: Array, pose: object = (0, 0, 0), half_ranges: Array = WIDE) -> GraspProblem:
    return GraspProblem(
        shape=Shape(vertices=vertices), pose=np.array(pose, dtype=float), half_ranges=half_ranges
    )


def moved(path: Array, pose: Array) -> Array:
    """A path around the object at the origin, moved with it to a pose."""
    return to_world(pose, path)


def mirrored(points: Array) -> Array:
    """Mirror image in the y axis."""
    return points * np.array([-1.0, 1.0])


def turned(vertices: Array, angle: float) -> Array:
    return vertices @ rotation(angle).T
