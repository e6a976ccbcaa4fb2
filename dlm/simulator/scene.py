"""What is simulated: one scene from one contact task, and batches of scenes with padded arrays."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from expert.geometry.polygon import facet_frames, facets, reflex_vertices
from expert.geometry.pose import Array
from expert.types import Body, ContactTask, Environment, HalfPlane, Trajectory, require

STIFFNESS_PER_MASS = 1e5
"""Finger stiffness over the object's mass [N/m per kg]: planned forces of m g deflect a finger by 0.1 mm."""


@dataclass(frozen=True, kw_only=True)
class Scene:
    """One object, its environment, the desired motion that the execution layer follows, and the fingers' springs.

    friction: at the fingers.  stiffness: of the springs that drive the fingers [N/m]; 0 means 1e5 N/m per kg of object.
    """

    body: Body
    environment: Environment
    trajectory: Trajectory
    friction: float
    stiffness: float = 0.0

    def __post_init__(self) -> None:
        require(0 <= self.friction < np.inf, "scene.friction", "a number >= 0", self.friction)
        require(0 <= self.stiffness < np.inf, "scene.stiffness", "a number >= 0", self.stiffness)
        if self.stiffness == 0:
            object.__setattr__(self, "stiffness", STIFFNESS_PER_MASS * self.body.mass)

    @classmethod
    def of(cls, task: ContactTask) -> "Scene":
        """The scene in which the plans of a task are executed."""
        return cls(
            body=task.body,
            environment=task.environment,
            trajectory=task.trajectory,
            friction=task.fingers.friction,
        )


class SceneArrays(NamedTuple):
    """B scenes as padded arrays, the compiled kernels' view.

    vertex_count, wall_count (B,); vertices, outward (unit facet normals) (B, V, 2); length (B, V) of facets [m];
    reflex (B, V); walls (B, W, 5): point, normal, friction; gravity (B,): along -y in the plane, 0 for transverse;
    support (B,): Coulomb force per vertex of the support plane [N]; path (B, T, 3): desired poses at the knots.
    """

    vertex_count: np.ndarray
    vertices: np.ndarray
    outward: np.ndarray
    length: np.ndarray
    reflex: np.ndarray
    mass: np.ndarray
    inertia: np.ndarray
    friction: np.ndarray
    stiffness: np.ndarray
    gravity: np.ndarray
    support: np.ndarray
    wall_count: np.ndarray
    walls: np.ndarray
    path: np.ndarray
    dt: np.ndarray


@dataclass(frozen=True)
class SceneBatch:
    """B scenes with the same number of knots."""

    arrays: SceneArrays

    @classmethod
    def of(cls, scenes: Sequence[Scene | ContactTask]) -> "SceneBatch":
        """Pad polygons and walls to common sizes.  Raises InvalidProblem for no scenes or unequal numbers of knots."""
        listed = [Scene.of(s) if isinstance(s, ContactTask) else s for s in scenes]
        require(len(listed) > 0, "scenes", "at least one scene", 0)
        steps = {len(s.trajectory.poses) for s in listed}
        require(len(steps) == 1, "scenes", "one number of poses for all", sorted(steps))
        return cls(_arrays(listed))

    def __len__(self) -> int:
        return len(self.arrays.mass)

    def __getitem__(self, rows: slice | Sequence[int] | np.ndarray) -> "SceneBatch":
        """Some of the scenes, as a batch of their own."""
        index = np.arange(len(self))[rows]
        return SceneBatch(SceneArrays(*(np.ascontiguousarray(a[index]) for a in self.arrays)))

    @property
    def steps(self) -> int:
        """T, the number of knots."""
        return self.arrays.path.shape[1]

    @property
    def desired(self) -> Array:
        """Desired poses (B, T, 3)."""
        return self.arrays.path

    def without_friction(self) -> "SceneBatch":
        """The same scenes with frictionless fingers and walls."""
        walls = self.arrays.walls.copy()
        walls[..., 4] = 0
        return SceneBatch(self.arrays._replace(friction=np.zeros(len(self)), walls=walls))


def _arrays(scenes: list[Scene]) -> SceneArrays:
    count = np.array([len(s.body.vertices) for s in scenes])
    walls = np.array([len(s.environment.walls) for s in scenes])
    frames = [facet_frames(s.body.vertices)[0] for s in scenes]
    return SceneArrays(
        vertex_count=count,
        vertices=_padded([s.body.vertices for s in scenes], count.max()),
        outward=_padded([-n for n in frames], count.max()),
        length=_padded([_lengths(s.body.vertices) for s in scenes], count.max()),
        reflex=_padded([reflex_vertices(s.body.vertices).astype(float) for s in scenes], count.max()) > 0,
        mass=np.array([s.body.mass for s in scenes], dtype=float),
        inertia=np.array([s.body.inertia for s in scenes], dtype=float),
        friction=np.array([s.friction for s in scenes], dtype=float),
        stiffness=np.array([s.stiffness for s in scenes], dtype=float),
        gravity=np.array([s.environment.gravity * (s.environment.plane == "sagittal") for s in scenes]),
        support=np.array([_support_force(s) for s in scenes]),
        wall_count=walls,
        walls=_padded([_wall_rows(s.environment.walls) for s in scenes], max(walls.max(), 1)),
        path=np.array([s.trajectory.poses for s in scenes], dtype=float),
        dt=np.array([s.trajectory.dt for s in scenes], dtype=float),
    )


def _padded(rows: Sequence[Array], size: int) -> Array:
    out = np.zeros((len(rows), size, *rows[0].shape[1:]))
    for k, row in enumerate(rows):
        out[k, : len(row)] = row
    return out


def _lengths(vertices: Array) -> Array:
    a, b = facets(vertices)
    return np.linalg.norm(b - a, axis=1)


def _wall_rows(walls: tuple[HalfPlane, ...]) -> Array:
    return np.array([[*w.point, *w.normal, w.friction] for w in walls]).reshape(-1, 5)


def _support_force(scene: Scene) -> float:
    """The weight rests evenly on the vertices, as in the planner's model of the support plane."""
    e = scene.environment
    if e.plane == "sagittal":
        return 0.0
    return e.support_friction * scene.body.mass * e.gravity / len(scene.body.vertices)
