"""Random object motions in the sagittal plane that start at rest on the floor and end at rest (Thesis 4.3).

Six families: slide, pivot about a ground vertex, lift, lift and rotate, slide then lift, pivot then lift.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np

from datasets.limits import Number, check_numbers
from datasets.shapes import ShapeFamily, Shapes, stable_angles
from expert.errors import InvalidProblem
from expert.geometry.pose import Array, rotation, to_world
from expert.problems.contact import ContactTask, Robustness
from expert.world.environment import Environment
from expert.world.fingers import Fingers
from expert.world.motion import Trajectory
from expert.world.shape import Body
from expert.world.values import require
from expert.world.walls import HalfPlane

ATTEMPTS = 200
AIR = 1e-3
"""Height over the floor that whatever leaves it, or comes near it, has at the end [m]."""
BETWEEN = 4
"""Points per step at which a motion is held against the floor."""


class NoRoom(InvalidProblem):
    """A shape has no motion of the wanted family."""


@dataclass(frozen=True, kw_only=True)
class Phase:
    """Rotation by `angle` [rad] about `pivot` (world frame; None: the centre of mass) together with a translation [m]."""

    shift: Array = field(default_factory=lambda: np.zeros(2))
    angle: float = 0.0
    pivot: Array | None = None

    def after(self, pose: Array, share: float) -> Array:
        """Pose (3,) once this share of the phase is done, starting from `pose`."""
        centre = pose[:2] if self.pivot is None else self.pivot
        angle = share * self.angle
        turned = centre + rotation(angle) @ (pose[:2] - centre)
        return np.array([*(turned + share * self.shift), pose[2] + angle])


@dataclass(frozen=True, kw_only=True)
class Rest:
    """An object at rest: its pose, and the outermost points (2,) of its line of contact with the floor, world frame."""

    pose: Array
    left: Array
    right: Array

    @classmethod
    def of(cls, body: Body, angle: float) -> "Rest":
        """Body turned by `angle`, lowered on the floor y = 0, its centre of mass at x = 0."""
        turned = to_world([0.0, 0.0, angle], body.vertices)
        pose = np.array([0.0, -turned[:, 1].min(), angle])
        corners = to_world(pose, body.vertices)
        touching = corners[corners[:, 1] < 1e-5 * body.size]
        return cls(pose=pose, left=touching[touching[:, 0].argmin()], right=touching[touching[:, 0].argmax()])


def _slide(rng: np.random.Generator, rest: Rest) -> list[Phase]:
    return [_translation(_either_way(rng, 0.01, 0.04), 0.0)]


def _pivot(rng: np.random.Generator, rest: Rest) -> list[Phase]:
    return [_tilt(rest, _either_way(rng, 0.1, 0.5))]


def _lift(rng: np.random.Generator, rest: Rest) -> list[Phase]:
    return [_translation(rng.uniform(-0.03, 0.03), rng.uniform(0.01, 0.04))]


def _lift_rotate(rng: np.random.Generator, rest: Rest) -> list[Phase]:
    (lift,) = _lift(rng, rest)
    return [Phase(shift=lift.shift, angle=_either_way(rng, 0.1, 0.5))]


def _slide_lift(rng: np.random.Generator, rest: Rest) -> list[Phase]:
    return [_translation(_either_way(rng, 0.008, 0.025), 0.0), _translation(0.0, rng.uniform(0.008, 0.025))]


def _pivot_lift(rng: np.random.Generator, rest: Rest) -> list[Phase]:
    """The centre of mass covers 0.8 to 2.5 cm in each phase.  Empty where no angle does that."""
    direction = _either_way(rng, 1.0, 1.0)
    radius = float(np.linalg.norm(rest.pose[:2] - _pivot_point(rest, direction)))
    least, most = max(0.1, 0.008 / radius), min(0.5, 0.025 / radius)
    if least > most:
        return []
    return [_tilt(rest, direction * rng.uniform(least, most)), _translation(0.0, rng.uniform(0.008, 0.025))]


FAMILIES: dict[str, Callable[[np.random.Generator, Rest], list[Phase]]] = {
    "slide": _slide,
    "pivot": _pivot,
    "lift": _lift,
    "lift_rotate": _lift_rotate,
    "slide_lift": _slide_lift,
    "pivot_lift": _pivot_lift,
}


def _either_way(rng: np.random.Generator, least: float, most: float) -> float:
    return float(rng.choice([-1.0, 1.0]) * rng.uniform(least, most))


def _translation(x: float, y: float) -> Phase:
    return Phase(shift=np.array([x, y]))


def _pivot_point(rest: Rest, angle: float) -> Array:
    """Counter-clockwise about the left end of the contact line, clockwise about the right end."""
    return rest.left if angle > 0 else rest.right


def _tilt(rest: Rest, angle: float) -> Phase:
    return Phase(angle=angle, pivot=_pivot_point(rest, angle))


def timed(share: float) -> float:
    """Smooth step from rest to rest: 3 s^2 - 2 s^3."""
    return share * share * (3 - 2 * share)


def poses_of(start: Array, phases: list[Phase], steps: int) -> Array:
    """Poses (steps, 3) at equal times; the phases follow one another, each from rest to rest in its share of the time."""
    poses, pose = [], np.asarray(start, dtype=float)
    clock = np.arange(steps) * len(phases) / (steps - 1)
    for k, phase in enumerate(phases):
        during = clock[(clock >= k) & ((clock < k + 1) | (k + 1 == len(phases)))]
        poses += [phase.after(pose, timed(t - k)) for t in during]
        pose = phase.after(pose, 1.0)
    return np.array(poses)


def sample_motion(
    rng: np.random.Generator,
    body: Body,
    family: str,
    *,
    steps: int = 5,
    dt: float = 0.1,
    spread: float = 0.01,
) -> Trajectory:
    """Motion of `family` from rest on a random stable side; its swept width is centred within `spread` [m] of x = 0.

    Raises InvalidProblem for an unknown family, NoRoom for a body that no motion of the family suits.
    """
    require(family in FAMILIES, "family", "one of " + ", ".join(FAMILIES), family)
    _check_steps(steps, "steps")
    angles = stable_angles(body.vertices, np.zeros(2))
    for _ in range(ATTEMPTS if len(angles) else 0):
        rest = Rest.of(body, float(rng.choice(angles)))
        phases = FAMILIES[family](rng, rest)
        if not phases:
            continue
        swept = to_world(poses_of(rest.pose, phases, BETWEEN * (steps - 1) + 1), body.vertices)
        if _clears_floor(swept, phases):
            poses = poses_of(rest.pose, phases, steps)
            poses[:, 0] += rng.uniform(-spread, spread) - (swept[..., 0].min() + swept[..., 0].max()) / 2
            return Trajectory.of(poses, dt, "rest")
    raise NoRoom(
        "object", expected=f"a shape with room for the motion {family}", got=f"none in {ATTEMPTS} draws"
    )


def _check_steps(steps: int, field: str) -> None:
    require(steps >= 5 and steps % 2 == 1, field, "an odd number >= 5, so that two phases share it", steps)


def _clears_floor(swept: Array, phases: list[Phase]) -> bool:
    """No vertex of the swept polygons (n, V, 2) enters the floor, and what a tilt or lift raises ends the phase well above it."""
    heights = swept[..., 1]
    ends = heights[:: (len(heights) - 1) // len(phases)][1:]
    return heights.min() > -1e-9 and all(map(_is_aloft, ends, phases))


def _is_aloft(heights: Array, phase: Phase) -> bool:
    """Heights (V,) at the end of a phase: all above AIR, but for the pivot of a tilt; a slide may stay as low as it is."""
    if phase.pivot is not None:
        return bool(np.sort(heights)[1] >= AIR)
    return phase.shift[1] == 0 or bool(heights.min() >= AIR)


@dataclass(frozen=True, kw_only=True)
class TaskSettings:
    """What is common to the tasks of a data set.  SI units; friction for fingers and floor alike.

    steps T and dt [s]: the video's frames.  force_limit: largest normal force of a finger over m g.  facet_margin,
    clearance [m]: see Fingers.  The rest: see Robustness; least_push is its min_normal_force over m g.
    """

    mass: Annotated[float, Number(unit="kilograms", above=0, most=1e6)] = 0.1
    friction: Annotated[float, Number(above=0, most=100)] = 0.5
    gravity: Annotated[float, Number(unit="m/s^2", above=0, most=1e4)] = 9.81
    steps: Annotated[int, Number(whole=True, least=5, most=1001)] = 5
    dt: Annotated[float, Number(unit="seconds", above=0, most=1e4)] = 0.1
    fingers: Annotated[int, Number(whole=True, least=1, most=8)] = 2
    force_limit: Annotated[float, Number(above=0, most=1e6)] = 10.0
    facet_margin: Annotated[float, Number(least=0, most=0.49)] = 0.05
    clearance: Annotated[float, Number(unit="metres", least=0, most=1)] = 0.005
    cone_fraction: Annotated[float, Number(above=0, most=1)] = 0.7
    support_inset: Annotated[float, Number(least=0, most=0.99)] = 0.3
    min_interval: Annotated[int, Number(whole=True, least=1, most=1000)] = 2
    least_push: Annotated[float, Number(least=0, most=1e6)] = 0.04

    def __post_init__(self) -> None:
        check_numbers(self, "tasks.")
        _check_steps(self.steps, "tasks.steps")
        self.environment(), self.point_fingers(), self.robustness()  # each checks its own part

    def task(self, body: Body, trajectory: Trajectory) -> ContactTask:
        """The task of moving `body` along `trajectory` over the floor y = 0."""
        return ContactTask(
            body=body,
            environment=self.environment(),
            trajectory=trajectory,
            fingers=self.point_fingers(),
            robustness=self.robustness(),
        )

    def environment(self) -> Environment:
        """Gravity, and the floor."""
        up = np.array([0.0, 1.0])
        floor = HalfPlane(point=np.zeros(2), normal=up, friction=self.friction, name="tasks.floor")
        return Environment(gravity=self.gravity, walls=(floor,))

    def point_fingers(self) -> Fingers:
        """Number, friction and limits."""
        return Fingers(
            count=self.fingers,
            friction=self.friction,
            max_force=self.force_limit * self.mass * self.gravity,
            facet_margin=self.facet_margin,
            clearance=self.clearance,
        )

    def robustness(self) -> Robustness:
        """Margins that let plans survive their execution."""
        return Robustness(
            cone_fraction=self.cone_fraction,
            support_inset=self.support_inset,
            min_normal_force=self.least_push * self.mass * self.gravity,
            min_interval=self.min_interval,
            free_clearance=self.clearance,
        )


Tasks = TaskSettings
"""The name under which checkpoints know them."""


def sample_task(
    rng: np.random.Generator,
    family: str,
    shapes: ShapeFamily | None = None,
    tasks: TaskSettings | None = None,
) -> ContactTask:
    """A random object and a random motion of `family`; the body frame is parallel to the world's at the first pose.

    Vertex 0 is the left end of the line on which the object rests.  Raises InvalidProblem as its parts do.
    """
    shapes, tasks = shapes or Shapes(), tasks or TaskSettings()
    body, _ = Body.uniform(shapes.sample(rng), tasks.mass)
    motion = sample_motion(rng, body, family, steps=tasks.steps, dt=tasks.dt)
    return tasks.task(*upright(body, motion))


def upright(body: Body, motion: Trajectory) -> tuple[Body, Trajectory]:
    """The same motion in a body frame that is parallel to the world's at the first pose; vertex 0 lies lowest, then leftmost."""
    angle = motion.poses[0, 2]
    corners = to_world([0.0, 0.0, angle], body.vertices)
    low = np.flatnonzero(corners[:, 1] < corners[:, 1].min() + 1e-5 * body.size)
    first = int(low[corners[low, 0].argmin()])
    turned = Body(vertices=np.roll(corners, -first, axis=0), mass=body.mass, inertia=body.inertia)
    return turned, Trajectory.of(motion.poses - [0.0, 0.0, angle], motion.dt, "rest")
