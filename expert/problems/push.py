"""Pushing an object on a table to a goal with one finger, and the plan that does so.

Quasi-static: the object moves only while it is pushed, and only as far.  The frame is that of the shape's vertices [m].
"""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np
import shapely

from expert.errors import InvalidProblem
from expert.geometry.polygon import mass_properties
from expert.geometry.pose import Array, to_world
from expert.world.shape import Shape
from expert.world.values import readonly, require, require_time
from expert.world.walls import Obstacle

ROOM = 0.75
"""Without a workspace there is this much room around start and goal, over the object's size."""

POINT = 1e-3
"""A point finger is a disc of this fraction of the object's size, so that it has a normal at corners too."""

Pressure = Literal["uniform", "ellipsoid"]


@dataclass(frozen=True, kw_only=True)
class LimitSurface:
    """How the support resists: `uniform` pressure on the polygon, or an `ellipsoid` about the centroid.

    c: of an ellipsoid, the greatest friction torque over the greatest friction force [m].
    """

    kind: Pressure = "uniform"
    c: float | None = None

    def __post_init__(self) -> None:
        require(
            self.kind in ("uniform", "ellipsoid"), "limit_surface.kind", "uniform or ellipsoid", self.kind
        )
        if self.kind == "uniform":
            require(self.c is None, "limit_surface.c", "none for uniform pressure, which has its own", self.c)
        else:
            stated = self.c is not None and 0 < self.c < np.inf
            require(stated, "limit_surface.c", "a positive length, which an ellipsoid needs", self.c)


@dataclass(frozen=True, kw_only=True)
class Finger:
    """Disc of a radius [m] (0: a point) with Coulomb friction, at `start` (2,) [m] in the beginning; speeds [m/s] with the
    object and without.
    """

    start: Array
    radius: float = 0.0
    friction: float = 0.0
    push_speed: float = 0.05
    travel_speed: float = 0.2

    def __post_init__(self) -> None:
        object.__setattr__(self, "start", readonly(self.start, (2,), "finger.start"))
        for name in ("radius", "friction"):
            value = getattr(self, name)
            require(0 <= value < np.inf, f"finger.{name}", "a number >= 0", value)
        for name in ("push_speed", "travel_speed"):
            value = getattr(self, name)
            require(0 < value < np.inf, f"finger.{name}", "a positive speed", value)


@dataclass(frozen=True, kw_only=True)
class Tolerance:
    """How far the object may end from its goal: its centroid [m], its angle [rad]."""

    position: float = 0.002
    angle: float = 0.035

    def __post_init__(self) -> None:
        for name in ("position", "angle"):
            value = getattr(self, name)
            require(0 < value < np.inf, f"tolerance.{name}", "a positive number", value)


@dataclass(frozen=True, kw_only=True)
class PushProblem:
    """Which pushes bring the object from start to goal (3,) [m, rad], angles modulo a turn?

    workspace: (x_min, y_min, x_max, y_max) [m], which neither object nor finger leaves; None: start and goal with room around.
    clearance [m]: kept by object and finger from obstacles, and by the finger on its way from the object.

    Raises InvalidProblem where start or goal do not fit, and where the finger fits nowhere.
    """

    shape: Shape
    start: Array
    goal: Array
    finger: Finger
    limit_surface: LimitSurface = field(default_factory=LimitSurface)
    tolerance: Tolerance = field(default_factory=Tolerance)
    obstacles: tuple[Obstacle, ...] = ()
    workspace: Array | None = None
    clearance: float = 0.002

    def __post_init__(self) -> None:
        for name in ("start", "goal"):
            object.__setattr__(self, name, readonly(getattr(self, name), (3,), name))
        if self.workspace is not None:
            object.__setattr__(self, "workspace", readonly(self.workspace, (4,), "workspace"))
            x, y, x_most, y_most = self.workspace
            require(x < x_most and y < y_most, "workspace", "x_min < x_max and y_min < y_max", self.workspace)
        require(0 < self.clearance < np.inf, "clearance", "a positive length", self.clearance)
        for name in ("start", "goal"):
            self._require_room(name, shapely.Polygon(self.outline(getattr(self, name))))
        self._require_finger()

    @cached_property
    def centroid(self) -> Array:
        """Of the shape's area (2,), in its frame: the centre of pressure."""
        return mass_properties(self.shape.vertices).centroid

    @cached_property
    def radius(self) -> float:
        """Of the disc that pushes [m]."""
        return max(self.finger.radius, POINT * self.shape.size)

    @cached_property
    def bounds(self) -> Array:
        """The workspace, stated or not."""
        if self.workspace is not None:
            return self.workspace
        corners = np.concatenate([self.outline(self.start), self.outline(self.goal), self.finger.start[None]])
        room = ROOM * self.shape.size + 2 * (self.radius + self.clearance)
        return np.concatenate([corners.min(axis=0) - room, corners.max(axis=0) + room])

    @cached_property
    def walls(self) -> Array:
        """The workspace as half-planes (4, 3): inward normal, normal . p."""
        low_x, low_y, high_x, high_y = self.bounds
        return np.array([[1, 0, low_x], [0, 1, low_y], [-1, 0, -high_x], [0, -1, -high_y]], dtype=float)

    def outline(self, poses: Array) -> Array:
        """The shape's vertices (..., V, 2) in the world."""
        return to_world(poses, self.shape.vertices)

    def finger_room(self, *, clearance: float) -> shapely.Geometry:
        """Where the finger's centre may be, but for the object."""
        low_x, low_y, high_x, high_y = self.bounds
        r = self.radius
        if min(high_x - low_x, high_y - low_y) <= 2 * r:
            return shapely.Polygon()
        solid = [shapely.Polygon(o.vertices).buffer(r + clearance) for o in self.obstacles]
        return shapely.box(low_x + r, low_y + r, high_x - r, high_y - r) - shapely.union_all(solid)

    def _require_room(self, name: str, object_there: shapely.Polygon) -> None:
        remedy = "move it, or enlarge the workspace"
        inside = shapely.box(*self.bounds).covers(object_there)
        require(
            inside, name, "a pose at which the object is inside the workspace", "one where it is not", remedy
        )
        for k, obstacle in enumerate(self.obstacles):
            near = shapely.Polygon(obstacle.vertices).distance(object_there)
            expected = f"a pose at which the object keeps {self.clearance:g} m from obstacles"
            got = f"one with {near:.3g} m to obstacles[{k}]" if near else f"one inside obstacles[{k}]"
            require(near >= self.clearance, name, expected, got, "move it, or the obstacle")

    def _require_finger(self) -> None:
        free = self.finger_room(clearance=self.clearance)
        start = shapely.Polygon(self.outline(self.start))
        beside = start.buffer(self.radius + self.clearance).exterior
        if free.intersection(beside).length < 1e-6 * self.shape.size:
            got = f"{self.finger.radius:g} m, which fits nowhere beside the object at its start"
            raise InvalidProblem("finger.radius", expected="a finger that fits", got=got, remedy="make room")
        at = shapely.Point(self.finger.start)
        clear = free.covers(at) and start.distance(at) >= self.radius + self.clearance
        expected = f"a place {self.clearance:g} m clear of object and obstacles, inside the workspace"
        require(clear, "finger.start", expected, self.finger.start.tolist(), "move it")


PushMethod = Literal["table"]


@dataclass(frozen=True, kw_only=True)
class PushOptions:
    """How to search (a beam over a table of pushes), for how long [s]; most pushes of a plan, and width of the beam."""

    method: PushMethod = "table"
    time_limit: float = 60.0
    depth: int = 10
    width: int = 150

    def __post_init__(self) -> None:
        require_time(self.time_limit)
        for name in ("depth", "width"):
            require(getattr(self, name) >= 1, f"options.{name}", "a number >= 1", getattr(self, name))


@dataclass(frozen=True, kw_only=True)
class Push:
    """The finger's way (n, 2) to where the push starts, the straight push's end (2,) [m], and the pose (3,) after it."""

    way: Array
    end: Array
    pose: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "way", readonly(self.way, (None, 2), "way"))
        object.__setattr__(self, "end", readonly(self.end, (2,), "end"))
        object.__setattr__(self, "pose", readonly(self.pose, (3,), "pose"))
        require(len(self.way) >= 1, "way", "at least the point where the push starts", "none")


PushStatus = Literal["solved", "no_plan", "time_limit"]


@dataclass(frozen=True, kw_only=True)
class PushPlan:
    """Pushes that bring the object to its goal, confirmed by `expert.verify.push.check`, or why there are none.

    status: solved, no_plan (none at this resolution: not a proof that there is none), time_limit.
    objective: duration of ways and pushes [s].  seconds: processor time.  nodes: partial plans that were expanded.
    """

    status: PushStatus
    pushes: tuple[Push, ...] = ()
    objective: float = np.nan
    seconds: float = 0.0
    nodes: int = 0
    reason: str = ""

    @property
    def found(self) -> bool:
        """Whether there is a plan."""
        return self.status == "solved"


def duration(finger: Finger, pushes: tuple[Push, ...]) -> float:
    """Of ways and pushes, from the finger's start on [s]."""
    at, total = finger.start, 0.0
    for push in pushes:
        way = np.concatenate([at[None], push.way])
        total += float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum()) / finger.travel_speed
        total += float(np.linalg.norm(push.end - push.way[-1])) / finger.push_speed
        at = push.end
    return total
