"""The nouns of contact-trajectory optimization.

Index legend, fixed everywhere: t step, c finger, f facet, j|k end point or cone ray, d coordinate; all count from 0.
SI units, angles in rad, counter-clockwise, y up; suffix `_w` world frame, `_b` body frame.
"""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np

from expert.errors import InvalidProblem
from expert.geometry.polygon import diameter, facet_frames, facets, mass_properties, simple_polygon
from expert.geometry.pose import Array, rotation, to_world

IntArray = np.ndarray[tuple[int, ...], np.dtype[np.int64]]

FREE = -1
"""Mode of a finger that touches no facet."""
SUPPORT = -1
"""Wall index of a contact with the support plane (transverse plane)."""


def readonly(values: object, shape: tuple[int | None, ...], field: str) -> Array:
    """Finite float array of the given shape (None: any length), made read-only.  Raises InvalidProblem."""
    try:
        array = np.array(values, dtype=float)
    except (TypeError, ValueError):
        array = np.array(np.nan)
    fits = array.ndim == len(shape) and all(n in (None, m) for n, m in zip(shape, array.shape, strict=False))
    if not fits:
        wanted = "(" + ", ".join("n" if n is None else str(n) for n in shape) + ")"
        raise InvalidProblem(field, expected=f"numbers of shape {wanted}", got=repr(values)[:60])
    if not np.isfinite(array).all():
        raise InvalidProblem(
            field, expected="finite numbers", got=repr(values)[:60], remedy="remove nan and inf"
        )
    array.setflags(write=False)
    return array


def require(ok: bool, field: str, expected: str, got: object, remedy: str = "") -> None:
    """Raise InvalidProblem unless `ok`; a comparison with nan is not ok."""
    if not ok:
        raise InvalidProblem(field, expected=expected, got=f"{got}", remedy=remedy)


@dataclass(frozen=True, kw_only=True)
class Body:
    """Polygonal rigid body; its frame's origin is the centre of mass.

    vertices: (V, 2) [m] counter-clockwise, facet k from vertex k to k + 1; mass [kg]; inertia [kg m^2] about the origin.
    """

    vertices: Array
    mass: float
    inertia: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "vertices", simple_polygon(self.vertices, field="object.vertices"))
        self.vertices.setflags(write=False)
        for name in ("mass", "inertia"):
            value = getattr(self, name)
            require(0 < value < np.inf, f"object.{name}", "a positive number", value)

    @classmethod
    def uniform(cls, vertices: object, mass: float) -> tuple["Body", Array]:
        """Body of uniform density and its centroid (2,) in the frame of the given vertices."""
        v = simple_polygon(vertices, field="object.vertices")
        plate = mass_properties(v)
        require(0 < mass < np.inf, "object.mass", "a positive number", mass)
        return cls(
            vertices=v - plate.centroid, mass=mass, inertia=mass * plate.second_moment / plate.area
        ), plate.centroid

    @cached_property
    def size(self) -> float:
        """Characteristic length L: the diameter [m]."""
        return diameter(self.vertices)

    def facets_w(self, pose: Array) -> tuple[Array, Array]:
        """End points a, b of all facets in the world frame at poses (..., 3), each (..., V, 2)."""
        a, b = facets(self.vertices)
        return to_world(pose, a), to_world(pose, b)

    def frames_w(self, pose: Array) -> tuple[Array, Array]:
        """Inward normals and tangents of all facets in the world frame at poses (..., 3), each (..., V, 2)."""
        turn = np.swapaxes(rotation(np.asarray(pose)[..., 2]), -1, -2)
        normal, tangent = facet_frames(self.vertices)
        return normal @ turn, tangent @ turn


@dataclass(frozen=True, kw_only=True)
class HalfPlane:
    """Wall: the free side is {x : normal . (x - point) >= 0}.  point [m], unit normal, world frame, shape (2,)."""

    point: Array
    normal: Array
    friction: float = 0.0
    name: str = "wall"

    def __post_init__(self) -> None:
        for key in ("point", "normal"):
            object.__setattr__(self, key, readonly(getattr(self, key), (2,), f"{self.name}.{key}"))
        length = float(np.linalg.norm(self.normal))
        require(
            abs(length - 1) < 1e-6,
            f"{self.name}.normal",
            "a unit vector",
            f"length {length:.3g}",
            "divide it by its length",
        )
        require(0 <= self.friction < np.inf, f"{self.name}.friction", "a number >= 0", self.friction)

    def gap(self, points: Array) -> Array:
        """Signed distance of points (..., 2) from the wall [m], negative inside."""
        return (np.asarray(points) - self.point) @ self.normal


@dataclass(frozen=True, kw_only=True)
class Environment:
    """Sagittal plane: gravity acts along -y.  Transverse plane: gravity presses the object on a support with friction."""

    plane: Literal["sagittal", "transverse"] = "sagittal"
    gravity: float = 9.81
    walls: tuple[HalfPlane, ...] = ()
    support_friction: float = 0.3

    def __post_init__(self) -> None:
        require(
            self.plane in ("sagittal", "transverse"),
            "environment.plane",
            "sagittal or transverse",
            self.plane,
        )
        require(0 < self.gravity < np.inf, "environment.gravity", "a positive number", self.gravity)
        friction = self.support_friction
        require(0 <= friction < np.inf, "environment.support_friction", "a number >= 0", friction)


@dataclass(frozen=True, kw_only=True)
class Trajectory:
    """Object motion: poses (T, 3) of the centre of mass every dt [s], and one pose outside the horizon at each end."""

    dt: float
    poses: Array
    before: Array
    after: Array

    def __post_init__(self) -> None:
        require(0 < self.dt < np.inf, "trajectory.dt", "a positive number of seconds", self.dt)
        object.__setattr__(self, "poses", readonly(self.poses, (None, 3), "trajectory.poses"))
        require(len(self.poses) >= 2, "trajectory.poses", "at least 2 poses", len(self.poses))
        for name in ("before", "after"):
            object.__setattr__(self, name, readonly(getattr(self, name), (3,), f"trajectory.{name}"))

    @classmethod
    def of(cls, poses: object, dt: float, ends: str = "steady") -> "Trajectory":
        """Poses with the stated end rule: steady (constant velocity goes on) or rest (at rest outside the horizon)."""
        q = readonly(poses, (None, 3), "trajectory.poses")
        require(len(q) >= 2, "trajectory.poses", "at least 2 poses", len(q))
        require(ends in ("steady", "rest"), "trajectory.ends", "steady or rest", ends)
        if ends == "rest":
            return cls(dt=dt, poses=q, before=q[0], after=q[-1])
        return cls(dt=dt, poses=q, before=2 * q[0] - q[1], after=2 * q[-1] - q[-2])

    @cached_property
    def extended(self) -> Array:
        """before, poses, after: (T + 2, 3)."""
        return np.concatenate([self.before[None], self.poses, self.after[None]])

    @cached_property
    def accelerations(self) -> Array:
        """Central second differences, (T, 3) [m/s^2, rad/s^2]."""
        q = self.extended
        return (q[2:] - 2 * q[1:-1] + q[:-2]) / self.dt**2


@dataclass(frozen=True, kw_only=True)
class Fingers:
    """Point fingers: count C, friction coefficient, largest normal force [N], fraction kept from facet ends, clearance [m].

    clearance is kept from walls; what free fingers keep from the object is Robustness.free_clearance.
    """

    count: int
    friction: float
    max_force: float
    facet_margin: float = 0.05
    clearance: float = 0.002

    def __post_init__(self) -> None:
        require(self.count >= 1, "fingers.count", "at least 1", self.count)
        require(0 < self.friction < np.inf, "fingers.friction", "a positive number", self.friction)
        require(
            0 < self.max_force < np.inf, "fingers.max_force", "a positive number of newtons", self.max_force
        )
        require(
            0 <= self.facet_margin <= 0.5,
            "fingers.facet_margin",
            "a fraction from 0 to 0.5",
            self.facet_margin,
        )
        require(0 <= self.clearance < np.inf, "fingers.clearance", "a length >= 0 in metres", self.clearance)


@dataclass(frozen=True, kw_only=True)
class Cost:
    """Weights of sum |lambda|^2 [1/N^2], sum |p_ddot|^2 [s^4/m^2] and of the distance to the cone's edge (beta)."""

    force: float = 1.0
    acceleration: float = 1.0
    margin: float = 0.0

    def __post_init__(self) -> None:
        for name in ("force", "acceleration", "margin"):
            value = getattr(self, name)
            require(0 <= value < np.inf, f"cost.{name}", "a number >= 0", value)


@dataclass(frozen=True, kw_only=True)
class Robustness:
    """Margins that let a plan survive open-loop execution; the defaults ask for none.

    cone_fraction: share of the friction used on fingers and sticking walls (sliding ones stay on their cone's edge).
    support_inset: share of the contact width by which line contacts with walls are drawn in.
    min_normal_force: least normal force of a finger wherever it may push [N].
    min_interval: least number of steps that a contact lasts.
    free_clearance: distance that a finger without contact keeps from the object [m].
    """

    cone_fraction: float = 1.0
    support_inset: float = 0.0
    min_normal_force: float = 0.0
    min_interval: int = 1
    free_clearance: float = 0.0

    def __post_init__(self) -> None:
        require(
            0 < self.cone_fraction <= 1,
            "robustness.cone_fraction",
            "a fraction in (0, 1]",
            self.cone_fraction,
        )
        require(
            0 <= self.support_inset < 0.5,
            "robustness.support_inset",
            "a fraction in [0, 0.5)",
            self.support_inset,
        )
        least = self.min_normal_force
        require(0 <= least < np.inf, "robustness.min_normal_force", "a force >= 0 in newtons", least)
        require(self.min_interval in (1, 2), "robustness.min_interval", "1 or 2", self.min_interval)
        away = self.free_clearance
        require(0 <= away < np.inf, "robustness.free_clearance", "a length >= 0 in metres", away)


@dataclass(frozen=True, kw_only=True)
class ContactTask:
    """Contact-trajectory optimization (Thesis 3.1): where and with what forces do fingers make this motion?"""

    body: Body
    environment: Environment
    trajectory: Trajectory
    fingers: Fingers
    cost: Cost = field(default_factory=Cost)
    robustness: Robustness = field(default_factory=Robustness)

    def __post_init__(self) -> None:
        for t, pose in enumerate(self.trajectory.poses):
            for k, wall in enumerate(self.environment.walls):
                depth = -float(wall.gap(to_world(pose, self.body.vertices)).min())
                require(
                    depth <= 2 * self.contact_tolerance,
                    f"trajectory.poses[{t}]",
                    f"an object on the free side of wall {k}",
                    f"{depth:.3g} m inside it",
                    "move the pose or the wall",
                )

    @property
    def steps(self) -> int:
        """T, the number of poses."""
        return len(self.trajectory.poses)

    @property
    def weight(self) -> float:
        """m g [N]."""
        return self.body.mass * self.environment.gravity

    @property
    def contact_tolerance(self) -> float:
        """Gaps and slips below this count as zero [m]."""
        return 1e-5 * self.body.size


Status = Literal["optimal", "feasible", "infeasible", "time_limit"]


@dataclass(frozen=True, kw_only=True)
class ContactForce:
    """Force [N] of wall `wall` (SUPPORT: the support plane) on object vertex `vertex`, acting at `point` [m], world frame."""

    step: int
    vertex: int
    wall: int
    point: Array
    force: Array


@dataclass(frozen=True, kw_only=True)
class Plan:
    """Answer to a ContactTask.

    status: optimal (gap certified), feasible (budget spent, plan found), infeasible (proved, see `reason`), time_limit (nothing found).
    objective, bound: SI cost and its certified lower bound.  modes (T, C): facet or FREE.
    positions (T, C, 2) [m] and forces (T, C, 2) [N, on the object], world frame.  Empty arrays where there is no plan.
    """

    status: Status
    objective: float = np.inf
    bound: float = -np.inf
    seconds: float = 0.0
    nodes: int = 0
    modes: IntArray = field(default_factory=lambda: np.empty((0, 0), dtype=np.int64))
    positions: Array = field(default_factory=lambda: np.empty((0, 0, 2)))
    forces: Array = field(default_factory=lambda: np.empty((0, 0, 2)))
    contact_forces: tuple[ContactForce, ...] = ()
    residual: float = np.nan
    reason: str = ""

    @property
    def gap(self) -> float:
        """(objective - bound) / objective; nan without a plan."""
        return (self.objective - self.bound) / max(abs(self.objective), 1e-12) if self.found else np.nan

    @property
    def found(self) -> bool:
        """Whether there is a plan to execute."""
        return self.status in ("optimal", "feasible")
