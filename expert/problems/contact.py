"""Contact-trajectory optimization (Thesis 3.1): the task and its answer."""

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from expert.geometry.pose import Array, to_world
from expert.world.environment import Environment
from expert.world.fingers import Fingers
from expert.world.motion import Trajectory
from expert.world.shape import Body
from expert.world.values import IntArray, require, require_time

FREE = -1
"""Mode of a finger that touches no facet."""
SUPPORT = -1
"""Wall index of a contact with the support plane (transverse plane)."""


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


ContactMethod = Literal["exact", "thesis", "scip"]


@dataclass(frozen=True, kw_only=True)
class ContactOptions:
    """How to solve: branch and bound over contact modes, MIQP1 of the thesis, or SCIP on the exact bilinear model.

    gap: relative optimality gap at which the search may stop.  time_limit [s].  node_limit: a budget that does not depend on
    the machine's load, of the exact method.
    """

    gap: float = 1e-3
    time_limit: float = 60.0
    method: ContactMethod = "exact"
    node_limit: int | None = None

    def __post_init__(self) -> None:
        require(0 <= self.gap < 1, "options.gap", "a fraction in [0, 1)", self.gap)
        require_time(self.time_limit)
        require(
            self.node_limit is None or self.node_limit >= 1, "options.node_limit", ">= 1", self.node_limit
        )


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
class Stated:
    """What is said of a plan's optimality: its gap (nan: nothing), and the gap that was asked for, at which it is `optimal`."""

    gap: float
    asked: float


@dataclass(frozen=True, kw_only=True)
class Plan:
    """Answer to a ContactTask.

    status: optimal (gap certified), feasible (budget spent, plan found), infeasible (proved, see `reason`), time_limit (nothing found).
    objective, bound: SI cost and its certified lower bound.  modes (T, C): facet or FREE.
    positions (T, C, 2) [m] and forces (T, C, 2) [N, on the object], world frame.  Empty arrays where there is no plan.
    certificate: what proves the bound, or that there is no plan (docs/theory/contact-certificate.md); None where nothing does.
    stated: what is said of its optimality, for the checker; None: nothing.
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
    certificate: dict[str, Any] | None = field(default=None, repr=False, compare=False)
    stated: Stated | None = field(default=None, repr=False, compare=False)

    @property
    def gap(self) -> float:
        """(objective - bound) / objective; nan without a plan."""
        return (self.objective - self.bound) / max(abs(self.objective), 1e-12) if self.found else np.nan

    @property
    def found(self) -> bool:
        """Whether there is a plan to execute."""
        return self.status in ("optimal", "feasible")
