"""Caging (Thesis 5.1): an object among obstacles (`Arrangement`), the search for fingers (`CageProblem`), and its answer.

The object is a polygon in its body frame [m].  Fingers are points and walls are segments, world frame [m].  The object's
open interior must not meet them: touching is allowed.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import shapely

from expert.errors import InvalidProblem
from expert.geometry.polygon import signed_distance
from expert.geometry.pose import Array, to_body
from expert.world.fingers import Gripper, require_grippers
from expert.world.shape import Shape
from expert.world.values import readonly, require, require_time
from expert.world.walls import Segment, segment_ends

START_TOLERANCE = 1e-7
"""A finger or wall may enter the object at the start pose by this fraction of its diameter."""


@dataclass(frozen=True, kw_only=True)
class Arrangement:
    """An object at a pose (3,) among fingers (N, 2) and walls: is it caged?

    Raises InvalidProblem for fewer than two fingers, and for fingers or walls inside the object.
    """

    shape: Shape
    pose: Array
    fingers: Array
    walls: tuple[Segment, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "pose", readonly(self.pose, (3,), "pose"))
        object.__setattr__(self, "fingers", readonly(self.fingers, (None, 2), "fingers.positions"))
        count = len(self.fingers)
        require(count >= 2, "fingers.positions", "at least 2 fingers", count, "one point cannot cage")
        inside = signed_distance(self.shape.vertices, to_body(self.pose, self.fingers))
        for k, distance in enumerate(inside):
            require(
                distance >= -self.start_tolerance,
                f"fingers.positions[{k}]",
                "a point outside the object",
                f"one {-distance:.3g} m inside it",
                "move the finger or the pose",
            )
        require_walls_outside(self.shape, self.pose, self.walls)

    @property
    def wall_ends(self) -> Array:
        """Ends of the walls (W, 2, 2) [m]."""
        return segment_ends(self.walls)

    @property
    def start_tolerance(self) -> float:
        """Depth [m] to which obstacles may enter the object at its start pose."""
        return START_TOLERANCE * self.shape.size


def require_walls_outside(shape: Shape, pose: Array, walls: Iterable[Segment]) -> None:
    """Raise InvalidProblem for a wall that enters the object."""
    core = shapely.Polygon(shape.vertices).buffer(-START_TOLERANCE * shape.size, join_style="mitre")
    for k, wall in enumerate(walls):
        crosses = core.intersects(shapely.LineString(to_body(pose, wall.ends)))
        require(not crosses, f"walls[{k}]", "a segment outside the object", "one that enters it", "move it")


CageCost = Literal["none", "min_separation", "max_opening"]
HalfRanges = tuple[tuple[float, float], ...]


@dataclass(frozen=True, kw_only=True)
class CageProblem:
    """Where do `count` fingers, on top of the fixed ones, cage the object at this pose? (Thesis 5.1)

    fewest: count is then the most fingers there are, and as few of them are used as the search can do with.
    margin: clearance that each condition keeps, relative to the object's diameter.
    rotation: pairs (below, above) of the half-ranges [rad] to try about the pose, in order; empty: the default ladder.
    parallel: all grippers open along one common direction, in world [rad], or searched where direction is None.
    """

    shape: Shape
    pose: Array
    count: int
    fewest: bool = False
    fixed: Array = field(default_factory=lambda: np.empty((0, 2)))
    walls: tuple[Segment, ...] = ()
    grippers: tuple[Gripper, ...] = ()
    parallel: bool = False
    direction: float | None = None
    cost: CageCost = "none"
    margin: float = 0.002
    rotation: HalfRanges = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "pose", readonly(self.pose, (3,), "pose"))
        fixed = readonly(np.reshape(self.fixed, (-1, 2)), (None, 2), "fingers.fixed")
        object.__setattr__(self, "fixed", fixed)
        self._require_counts()
        self._require_ranges()
        inside = signed_distance(self.shape.vertices, to_body(self.pose, fixed))
        for k, distance in enumerate(inside):
            outside = distance >= -START_TOLERANCE * self.shape.size
            require(outside, f"fingers.fixed[{k}]", "a point outside the object", "one inside it")
        require_walls_outside(self.shape, self.pose, self.walls)

    @property
    def wall_ends(self) -> Array:
        """Ends of the walls (W, 2, 2) [m]."""
        return segment_ends(self.walls)

    def _require_counts(self) -> None:
        require(self.count >= 0, "fingers.count", "a number >= 0", self.count)
        total = self.count + len(self.fixed)
        require(total >= 2, "fingers", "at least 2 fingers, fixed ones included", total)
        alone = not (self.fewest and self.grippers)
        require(alone, "fingers.fewest", "false with grippers, which name their fingers", "true")
        require_grippers(self.grippers, self.count)

    def _require_ranges(self) -> None:
        require(0 < self.margin < 0.1, "options.margin", "a fraction between 0 and 0.1", self.margin)
        if self.direction is not None:
            known = self.parallel and bool(np.isfinite(self.direction))
            require(known, "fingers.direction", "a finite angle, and parallel: true", self.direction)
        for below, above in self.rotation:
            fits = 0 < below < np.pi and 0 < above < np.pi
            got = f"[{-np.degrees(below):g}, {np.degrees(above):g}] deg"
            require(fits, "options.rotation", "ranges around the pose, each side between 0 and 180 deg", got)
        if self.cost not in ("none", "min_separation", "max_opening"):
            raise InvalidProblem("cost", expected="none, min_separation or max_opening", got=str(self.cost))
        if self.cost == "max_opening":
            fits = self.count in (2, 3) and not self.fewest
            got = f"{self.count} fingers" + (" or fewer" if self.fewest else "")
            require(fits, "cost", "max_opening with 2 or 3 searched fingers", got, "choose another cost")

    def arrangement(self, fingers: Array) -> Arrangement:
        """The object among searched fingers (count, 2), fixed fingers and walls."""
        return Arrangement(
            shape=self.shape,
            pose=self.pose,
            fingers=np.concatenate([np.reshape(fingers, (-1, 2)), self.fixed]),
            walls=self.walls,
        )


CageMethod = Literal["swept", "model", "thesis"]
CageSolver = Literal["highs", "scip"]


@dataclass(frozen=True, kw_only=True)
class CageOptions:
    """How to search, with which solver, for how long [s].

    swept: the model, and immobilising grasps where it is slow; model: the model alone; thesis: MIP1.
    """

    method: CageMethod = "swept"
    solver: CageSolver = "highs"
    time_limit: float = 60.0

    def __post_init__(self) -> None:
        require_time(self.time_limit)


CageStatus = Literal["caged", "none_found", "time_limit"]


@dataclass(frozen=True, kw_only=True)
class Meeting:
    """Obstacle piece `piece` of element `element` overlaps `next_piece` of the next element of the loop.

    Elements are the searched fingers, then the fixed ones, then the walls; pieces index the object's convex cover.
    """

    element: int
    piece: int
    next_element: int
    next_piece: int


@dataclass(frozen=True, kw_only=True)
class CageSolution:
    """Fingers that cage an object, confirmed by `expert.verify.cage.check`, or why there are none.

    status: caged (verified), none_found (no cage of the kind that was searched for, at the half-ranges tried: not a
    proof that none exists), time_limit (nothing verified in time).
    fingers (count, 2) [m], without the fixed ones.  rotation_range: verified orientations [rad].
    objective: cost [m or m^2], nan without cost.  seconds: processor time.  attempts: models solved and grasps tried.  refuted, unconfirmed: answers of the model
    that the verifier refuted or could not decide; they were cut off.
    """

    status: CageStatus
    fingers: Array = field(default_factory=lambda: np.empty((0, 2)))
    rotation_range: tuple[float, float] | None = None
    topology: tuple[Meeting, ...] = ()
    objective: float = np.nan
    seconds: float = 0.0
    attempts: int = 0
    refuted: int = 0
    unconfirmed: int = 0
    reason: str = ""

    @property
    def found(self) -> bool:
        """Whether there is a verified cage."""
        return self.status == "caged"
