"""The nouns of certified grasping: the search (`GraspProblem`) and its answer (`GraspSolution`).

Lengths are metres, world frame.  The object rests on a table; fingers are points that move without friction against it.
"""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from expert.geometry.pose import Array
from expert.problems.cage import Arrangement
from expert.world.fingers import Gripper, require_grippers
from expert.world.shape import Shape
from expert.world.values import readonly, require, require_time

GraspStatus = Literal["certified", "uncertified", "none_found", "time_limit"]
GraspCost = Literal["attraction", "acceleration"]
GraspMethod = Literal["goal_cell", "decomposed", "miqp1", "miqp2"]
LAST_RANGE = 0.5
"""Half-range [deg] at the last knot of a schedule."""


def schedule(first: float = 15.0) -> Array:
    """The usual half-ranges [deg] for the largest of them: equal steps down to a quarter, then LAST_RANGE."""
    return np.array([first, 0.75 * first, 0.5 * first, 0.25 * first, LAST_RANGE])


@dataclass(frozen=True, kw_only=True)
class GraspOptions:
    """How to search: goal cells (and where they fail the decomposed search), or the thesis's MIQP1, MIQP2; time_limit [s]."""

    method: GraspMethod = "goal_cell"
    time_limit: float = 60.0

    def __post_init__(self) -> None:
        require_time(self.time_limit)


@dataclass(frozen=True, kw_only=True)
class GraspProblem:
    """Which finger paths bring every nearby start of the object to the goal pose (3,)? (Thesis 5.2 Problem 1)

    half_ranges (K,) [rad], strictly decreasing: knot k keeps the object within +-half_ranges[k] of the goal orientation.
    cost: `attraction` makes the set of starts large, `acceleration` the finger paths smooth.
    parallel: all grippers open along the world's x axis.
    margin: clearance that each condition keeps, relative to the object's diameter.
    Raises InvalidProblem.
    """

    shape: Shape
    pose: Array
    count: int = 4
    half_ranges: Array = field(default_factory=lambda: np.radians(schedule()))
    cost: GraspCost = "attraction"
    grippers: tuple[Gripper, ...] = ()
    parallel: bool = False
    margin: float = 0.001

    def __post_init__(self) -> None:
        object.__setattr__(self, "pose", readonly(self.pose, (3,), "pose"))
        ranges = readonly(self.half_ranges, (None,), "options.half_ranges")
        object.__setattr__(self, "half_ranges", ranges)
        require(self.count in (3, 4), "fingers.count", "3 or 4", self.count)
        decreasing = len(ranges) >= 2 and bool((np.diff(ranges) < 0).all())
        inside = decreasing and ranges[-1] > 0 and ranges[0] < np.pi / 2
        what = "two or more decreasing angles between 0 and 90 deg"
        require(inside, "options.half_ranges", what, np.degrees(ranges).round(3).tolist())
        require(0 < self.margin < 0.1, "options.margin", "a fraction between 0 and 0.1", self.margin)
        require(self.cost in ("attraction", "acceleration"), "cost", "attraction or acceleration", self.cost)
        require_grippers(self.grippers, self.count)


@dataclass(frozen=True, kw_only=True)
class GraspSolution:
    """Finger paths, and what they promise.

    status: certified (the independent checker found nested cages, no dead end and a form-closed end), uncertified (paths
    that it did not confirm, with `reason`), none_found (no grasp of the kind searched for: not a proof that none exists),
    time_limit.
    path (K, N, 2) [m]: knots of the fingers, straight lines between them; knot k belongs to half_ranges[k].
    facets (N,): object facet (vertex index of its first end) that each finger touches in the end.
    starts (M, 2) [m]: polygon of goal-relative translations at the goal orientation from which the method itself promises
    success (Q0, inner approximation); empty where it promises none.
    objective: value of the cost.  refuted: answers that the checker did not confirm before this one.
    """

    status: GraspStatus
    path: Array = field(default_factory=lambda: np.empty((0, 0, 2)))
    facets: tuple[int, ...] = ()
    starts: Array = field(default_factory=lambda: np.empty((0, 2)))
    objective: float = np.nan
    method: str = ""
    seconds: float = 0.0
    refuted: int = 0
    reason: str = ""

    @property
    def found(self) -> bool:
        """Whether there is a grasp that the checker confirmed."""
        return self.status == "certified"

    def fingers(self, s: float) -> Array:
        """Finger positions (N, 2) [m] at path parameter s in [0, K - 1]."""
        k = min(int(s), len(self.path) - 2)
        return self.path[k] + (s - k) * (self.path[k + 1] - self.path[k])


def arrangement_at(problem: GraspProblem, solution: GraspSolution, s: float) -> Arrangement:
    """The object at the goal among the fingers at path parameter s."""
    return Arrangement(shape=problem.shape, pose=problem.pose, fingers=solution.fingers(s))
