"""What is simulated: one scene from one contact task, and batches of scenes with padded arrays."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from expert.geometry.polygon import facet_frames, facets, reflex_vertices
from expert.geometry.pose import Array
from expert.problems.contact import ContactTask
from expert.world.environment import Environment
from expert.world.motion import Trajectory
from expert.world.shape import Body
from expert.world.values import require
from expert.world.walls import HalfPlane

STIFFNESS_PER_MASS = 1e5
"""Finger stiffness over the object's mass [N/m per kg]: planned forces of m g deflect a finger by 0.1 mm."""
PUSHING = 0.02
"""A finger counts as loaded where its force exceeds this share of the object's weight: half the least push of the expert's
plans, and far above what solvers and networks leave of a zero."""


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


FACET_ROW = np.dtype([(name, "f8") for name in ("x", "y", "ox", "oy", "length", "reflex")])
"""A facet: start vertex, unit outward normal, length [m], and whether the start vertex is reflex (0 or 1)."""
WALL_ROW = np.dtype([(name, "f8") for name in ("x", "y", "nx", "ny", "friction")])
"""A half-plane: point, unit normal towards the free side, friction."""


class SceneArrays(NamedTuple):
    """B scenes as padded arrays, the compiled kernels' view.

    vertex_count, wall_count (B,); facets (B, V) of FACET_ROW; walls (B, W) of WALL_ROW; gravity (B,): along -y in the
    sagittal plane, 0 in the transverse one; weight (B,): m g in either; support (B,): Coulomb force per vertex of the
    support plane [N]; path (B, T, 3): desired poses at the knots.
    """

    vertex_count: np.ndarray
    facets: np.ndarray
    mass: np.ndarray
    inertia: np.ndarray
    friction: np.ndarray
    stiffness: np.ndarray
    gravity: np.ndarray
    weight: np.ndarray
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

    def loaded(self, forces: np.ndarray) -> np.ndarray:
        """Flags (B, T, C): the finger's force (B, T, C, 2) is that of a push.  Forces that are not finite are none."""
        with np.errstate(invalid="ignore", over="ignore"):
            return np.hypot(forces[..., 0], forces[..., 1]) > PUSHING * self.arrays.weight[:, None, None]

    def without_friction(self) -> "SceneBatch":
        """The same scenes with frictionless fingers and walls."""
        walls = self.arrays.walls.copy()
        walls["friction"] = 0
        return SceneBatch(self.arrays._replace(friction=np.zeros(len(self)), walls=walls))


def _arrays(scenes: list[Scene]) -> SceneArrays:
    facet_rows = [_facet_rows(s.body.vertices) for s in scenes]
    wall_rows = [_wall_rows(s.environment.walls) for s in scenes]
    return SceneArrays(
        vertex_count=np.array([len(rows) for rows in facet_rows]),
        facets=_padded(facet_rows),
        mass=np.array([s.body.mass for s in scenes], dtype=float),
        inertia=np.array([s.body.inertia for s in scenes], dtype=float),
        friction=np.array([s.friction for s in scenes], dtype=float),
        stiffness=np.array([s.stiffness for s in scenes], dtype=float),
        gravity=np.array([s.environment.gravity * (s.environment.plane == "sagittal") for s in scenes]),
        weight=np.array([s.body.mass * s.environment.gravity for s in scenes]),
        support=np.array([_support_force(s) for s in scenes]),
        wall_count=np.array([len(rows) for rows in wall_rows]),
        walls=_padded(wall_rows),
        path=np.array([s.trajectory.poses for s in scenes], dtype=float),
        dt=np.array([s.trajectory.dt for s in scenes], dtype=float),
    )


def _padded(rows: list[np.ndarray]) -> np.ndarray:
    out = np.zeros((len(rows), max(1, *(len(r) for r in rows))), dtype=rows[0].dtype)
    for k, row in enumerate(rows):
        out[k, : len(row)] = row
    return out


def _facet_rows(vertices: Array) -> np.ndarray:
    a, b = facets(vertices)
    rows = np.zeros(len(vertices), dtype=FACET_ROW)
    rows["x"], rows["y"] = a.T
    rows["ox"], rows["oy"] = -facet_frames(vertices)[0].T
    rows["length"] = np.linalg.norm(b - a, axis=1)
    rows["reflex"] = reflex_vertices(vertices)
    return rows


def _wall_rows(walls: tuple[HalfPlane, ...]) -> np.ndarray:
    return np.array([(*w.point, *w.normal, w.friction) for w in walls], dtype=WALL_ROW)


def _support_force(scene: Scene) -> float:
    """The weight rests evenly on the vertices, as in the planner's model of the support plane."""
    e = scene.environment
    if e.plane == "sagittal":
        return 0.0
    return e.support_friction * scene.body.mass * e.gravity / len(scene.body.vertices)
