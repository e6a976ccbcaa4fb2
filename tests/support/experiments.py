"""Starts and finger paths for experiments: hard starts of certified grasps, and paths that nobody certified."""

import numpy as np

from expert.geometry.polygon import signed_distance
from expert.geometry.pose import Array, to_body
from expert.verify.grasp.dead_ends import DeadEndEvent, dead_end_events
from expert.verify.grasp.finger_path import FingerPath
from expert.verify.grasp.start_set import StartSet
from expert.world.named import named_shape
from expert.world.shape import Shape
from tests.support.polygons import GRASPED, irregular_polygon

POOL, DIRECTIONS = 2000, 150


def hard_starts(path: FingerPath, starts: StartSet, rng: np.random.Generator) -> Array:
    """Starts (M, 3) where failure is likeliest: dead ends that happen to lie in Q0, and the outermost of many random ones."""
    places = [np.empty((0, 3))]
    for event in dead_end_events(path):
        poses = path.frame.world_pose(event.configurations(3))
        free = path.gap(path.configurations(poses), 0.0) > 0
        places.append(poses[free & starts.contains(poses)])
    pool = starts.starts(rng, POOL)
    scaled = pool - pool.mean(axis=0)
    scaled /= np.abs(scaled).max(axis=0)
    outermost = np.unique((scaled @ rng.normal(size=(3, DIRECTIONS))).argmax(axis=0))
    return np.concatenate([*places, pool[outermost]])


def closing_path(seed: int) -> tuple[Shape, Array, Array]:
    """An object, four fingers that close on it somehow, paths (3, 4, 2), and starts (M, 3) that no finger enters."""
    rng = np.random.default_rng(seed)
    named = seed % 3 == 0
    vertices = (
        named_shape(GRASPED[seed // 3 % 6]) if named else irregular_polygon(rng, int(rng.integers(4, 7)))
    )
    shape = Shape(vertices=vertices)
    angles = np.sort(rng.uniform(0, 2 * np.pi, 4)) + rng.uniform(0, 6)
    rays = np.column_stack([np.cos(angles), np.sin(angles)])
    far = shape.size * rng.uniform(0.75, 0.9, (4, 1)) * rays
    near = far * rng.uniform(0.1, 0.6, (4, 1)) + rng.normal(0, 0.1 * shape.size, (4, 2))
    middle = (far + near) / 2 + rng.normal(0, 0.05 * shape.size, (4, 2))
    starts = np.column_stack([rng.normal(0, 0.1 * shape.size, (40, 2)), rng.uniform(-np.pi, np.pi, 40)])
    free = [signed_distance(vertices, to_body(q, far)).min() > 0 for q in starts]
    return shape, np.stack([far, middle, near]), starts[free]


def miss(event: DeadEndEvent, s: float, configuration: Array) -> float:
    """How far a stall at s and a relative configuration (3,) is from a predicted dead end and its slide."""
    off, slide = configuration - event.first, event.last - event.first
    off[2] = (off[2] + np.pi) % (2 * np.pi) - np.pi
    length = float(slide @ slide)
    share = np.clip(off @ slide / length, 0, 1) if length > 0 else 0.0
    return float(max(abs(event.s - s), np.abs(off - share * slide).max()))
