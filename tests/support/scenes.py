"""Scenes and plans made without the expert: by hand where the mechanics is simple, at random where it need not be."""

from dataclasses import dataclass

import numpy as np
import torch

from datasets.shapes import Shapes, sample_polygon
from dlm.simulator import Scene, SceneBatch
from expert.geometry.polygon import facet_frames
from expert.geometry.pose import Array, rotation, to_world
from expert.world.environment import Environment
from expert.world.motion import Trajectory
from expert.world.shape import Body
from expert.world.walls import HalfPlane

MASS, G, MU, T, DT = 0.1, 9.81, 0.5, 5, 0.1
WEIGHT = MASS * G
BLOCK = np.array([[0, 0], [0.06, 0], [0.06, 0.04], [0, 0.04]])
FLOOR = HalfPlane(point=np.zeros(2), normal=np.array([0.0, 1.0]), friction=MU)
TABLE = Environment(plane="transverse", support_friction=0.3)


@dataclass(frozen=True)
class Case:
    """A scene and a plan for it, positions and forces (T, C, 2)."""

    scene: Scene
    positions: Array
    forces: Array


def block() -> Body:
    return Body.uniform(BLOCK, MASS)[0]


def scene(body: Body, poses: Array, environment: Environment | None = None) -> Scene:
    where = environment or Environment(walls=(FLOOR,))
    return Scene(body=body, environment=where, trajectory=Trajectory.of(poses, DT, "rest"), friction=MU)


def push(distance: float = 0.03) -> Case:
    """A block on the floor, pushed to the right by one finger against friction and inertia; the other one idles."""
    poses = np.column_stack([np.linspace(0, distance, T), np.full(T, 0.02), np.zeros(T)])
    s = scene(block(), poses)
    positions, forces = np.zeros((T, 2, 2)), np.zeros((T, 2, 2))
    positions[:, 0] = poses[:, :2] + [-0.03, -0.01]
    positions[:, 1] = poses[:, :2] + [0.05, 0.03]
    forces[:, 0, 0] = MU * WEIGHT + MASS * s.trajectory.accelerations[:, 0]
    return Case(s, positions, forces)


def lift(height: float = 0.03) -> Case:
    """A block squeezed from both sides and lifted."""
    poses = np.column_stack([np.zeros(T), 0.02 + np.linspace(0, height, T), np.zeros(T)])
    s = scene(block(), poses)
    up = 0.5 * (WEIGHT + MASS * s.trajectory.accelerations[:, 1])
    positions, forces = np.zeros((T, 2, 2)), np.zeros((T, 2, 2))
    for c, side in enumerate((-1, 1)):
        positions[:, c] = poses[:, :2] + [side * 0.03, 0]
        forces[:, c] = np.column_stack([-side * 3 * up, up])
    return Case(s, positions, forces)


def transverse_push(distance: float = 0.03) -> Case:
    """A block on a table, pushed along by one finger through its centre."""
    poses = np.column_stack([np.linspace(0, distance, T), np.zeros(T), np.zeros(T)])
    s = scene(block(), poses, TABLE)
    positions, forces = np.zeros((T, 1, 2)), np.zeros((T, 1, 2))
    positions[:, 0] = poses[:, :2] + [-0.03, 0]
    forces[:, 0, 0] = 0.3 * WEIGHT + MASS * s.trajectory.accelerations[:, 0]
    return Case(s, positions, forces)


def random_case(rng: np.random.Generator, *, fingers: int = 2, plane: str = "sagittal") -> Case:
    """A random polygon, a random motion, and fingers that push somewhere with forces of about the weight.

    Nothing here is balanced: the object tumbles, slips and falls.
    """
    few = int(rng.integers(3, 9))
    vertices = sample_polygon(rng, Shapes(facets=(few, few), slightest_turn=0.05, shortest_facet=0.2))
    body, _ = Body.uniform(vertices, MASS)
    angle = rng.uniform(-np.pi, np.pi)
    low = to_world([0, 0, angle], body.vertices)[:, 1].min()
    floor = HalfPlane(point=np.zeros(2), normal=np.array([0.0, 1.0]), friction=rng.uniform(0.1, 0.9))
    wall = HalfPlane(point=np.array([-0.1, 0.0]), normal=np.array([1.0, 0.0]), friction=rng.uniform(0, 0.5))
    where = Environment(plane=plane, walls=(floor, wall) if plane == "sagittal" else (), support_friction=0.3)
    start = np.array([0.0, -low, angle])
    moves = np.cumsum(rng.normal(0, [0.004, 0.004, 0.05], (T - 1, 3)), axis=0)
    poses = np.vstack([start, start + moves])
    positions, forces = np.zeros((T, fingers, 2)), np.zeros((T, fingers, 2))
    inward, tangent = facet_frames(body.vertices)
    for c in range(fingers):
        k, share = int(rng.integers(few)), rng.uniform(0.2, 0.8)
        point = body.vertices[k] + share * (body.vertices[(k + 1) % few] - body.vertices[k])
        push = (
            rng.uniform(0.2, 2, (T, 1)) * WEIGHT * (inward[k] + rng.uniform(-0.8, 0.8, (T, 1)) * tangent[k])
        )
        for t in range(T):
            positions[t, c] = to_world(poses[t], point[None])[0]
            forces[t, c] = rotation(poses[t, 2]) @ push[t]
    return Case(
        Scene(
            body=body,
            environment=where,
            trajectory=Trajectory.of(poses, DT, "rest"),
            friction=rng.uniform(0.2, 0.8),
        ),
        positions,
        forces,
    )


def batch_of(cases: list[Case]) -> tuple[SceneBatch, torch.Tensor, torch.Tensor]:
    """Cases with equally many fingers as one batch; the tensors ask for gradients."""
    positions = torch.tensor(np.array([c.positions for c in cases]), requires_grad=True)
    forces = torch.tensor(np.array([c.forces for c in cases]), requires_grad=True)
    return SceneBatch.of([c.scene for c in cases]), positions, forces
