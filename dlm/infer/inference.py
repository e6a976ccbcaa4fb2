"""From a video to the fingers' action and what comes of it in simulation."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import shapely

from datasets.limits import Number, check_numbers
from datasets.motions import TaskSettings
from dlm.infer.clip import Clip, VideoFile, read_clip
from dlm.infer.segmentation import Segmentation
from dlm.infer.steadiness import camera_shift
from dlm.infer.view import View, find_floor, lowest_row, view_of
from dlm.perception import Perceived, PerceptionSettings, perceive
from dlm.simulator.replay import Replay, replay
from dlm.structured import ClassPlanner, ExpertPlanner, Planned, StructuredModel
from dlm.structured.trial import Trial
from expert.errors import InvalidProblem
from expert.files import problem_for, solution_fields
from expert.geometry.polygon import diameter
from expert.geometry.pose import to_world
from expert.problems.contact import ContactTask, Plan
from expert.world.values import require

Refine = Literal["expert"]
WITHIN_MM, WITHIN_DEG = 2.0, 2.0
CODEC = 10.0
"""Errors of usual compression near edges [grey levels]."""
EXTENTS = (28.0, 24.0, 34.0)
"""Of the object in what perception is shown, where the video has as many pixels; others are tried where the first fits badly."""
NEEDLESS = 0.15
"""Corners that change the outline by less are left out [pixels that perception is shown]."""
STEADY = 0.35
"""Shift of the surroundings that is no movement of the camera [pixels of the video]."""
UNKNOWN_SCALE = 1e-3
"""Metres per pixel while the object's size has yet to be measured in pixels."""


@dataclass(frozen=True, kw_only=True)
class Given:
    """What a video cannot say.

    scale: metres per pixel of the video; or object_size: greatest extent of the object [m].  floor: row of the floor's surface
    [pixels from the top]; None: where the ground's colour begins, or else the object's lowest point.  mass [kg], friction:
    of fingers and floor alike.  duration [s] that the motion is to take; None: as in the video.
    """

    scale: Annotated[float | None, Number(unit="metres per pixel", above=0, most=1e6)] = None
    object_size: Annotated[float | None, Number(unit="metres", above=0, most=1e6)] = None
    floor: Annotated[float | None, Number(unit="pixels")] = None
    mass: Annotated[float, Number(unit="kilograms", above=0, most=1e6)] = 0.1
    friction: Annotated[float, Number(above=0, most=100)] = 0.5
    duration: Annotated[float | None, Number(unit="seconds", above=0, most=1e6)] = None

    def __post_init__(self) -> None:
        known = (self.scale is None) + (self.object_size is None)
        require(
            known == 1,
            "scale",
            "scale (metres per pixel) or object_size (greatest extent in metres)",
            "neither" if known == 2 else "both",
            "give one of them",
        )
        check_numbers(self)


@dataclass(frozen=True, kw_only=True)
class Inference:
    """Answer to a video.

    status: planned; risky (a plan that fails in some trials); poor_fit (a plan, but what was seen does not explain the video
    well); no_plan.  reason: in words.
    result: the plan as it goes in the simulator, on the object as perceived; None without a plan.
    """

    clip: Clip
    view: View
    planned: Planned
    result: Replay | None

    @property
    def status(self) -> str:
        return self.planned.status

    @property
    def reason(self) -> str:
        return self.planned.reason

    @property
    def plan(self) -> Plan | None:
        return self.planned.plan

    @property
    def task(self) -> ContactTask | None:
        return self.planned.task

    @property
    def follows(self) -> bool:
        """Whether the simulated object ends within 2 mm and 2 deg of where the video has it."""
        if self.result is None:
            return False
        mm, deg = self.result.final_error
        return mm <= WITHIN_MM and deg <= WITHIN_DEG

    def solution(self) -> dict[str, Any]:
        """Actions as a solution file, which `python -m expert verify|draw` and `python -m dlm.simulator` read."""
        if self.plan is None or self.task is None:
            raise InvalidProblem("plan", expected="a plan", got=f"none: {self.reason}")
        return solution_fields(problem_for(self.task, description="perceived in a video"), self.plan)


def infer(
    video: str | Path | VideoFile | Clip,
    given: Given,
    *,
    segmentation: Segmentation | None = None,
    model: StructuredModel | None = None,
    refine: Refine | None = None,
) -> Inference:
    """Positions and forces of two point fingers that move the object of a video as the video shows.

    model: how to plan; None: every contact class is checked, which needs no weights, and plans are tried out in simulation.
    refine: "expert" lets the expert plan, slower and over all contact sequences; without it, that happens only where the model
    finds no plan.  Raises InvalidProblem, one line, for a video without one object that stays in view.
    """
    require(refine in (None, "expert"), "refine", "expert or nothing", refine)
    model = model or StructuredModel(planner=ClassPlanner(trial=Trial()))
    model = replace(model, perception=replace(model.perception, codec=CODEC))
    steps = model.planning.tasks.steps
    known = isinstance(video, str | Path | VideoFile | Clip)
    require(known, "video", "a file, or Clip(frames=..., times=...)", type(video).__name__)
    clip = video if isinstance(video, Clip) else read_clip(video, steps=steps)
    view, seen = look(clip, given, segmentation or Segmentation(), model.perception)
    planning = replace(model.planning, tasks=tasks_of(model.planning.tasks, given, clip))
    by_model = replace(model, planning=planning)
    by_expert = replace(by_model, planner=ExpertPlanner())
    motion = resampled(seen, clip, steps)
    planned = (by_expert if refine else by_model).plan(motion)
    if planned.plan is None and not refine:
        planned = by_expert.plan(motion)
    result = None
    if planned.plan is not None and planned.task is not None:
        result = replay(planned.task, planned.plan.positions, planned.plan.forces)
    return Inference(clip=clip, view=view, planned=planned, result=result)


def look(
    clip: Clip, given: Given, segmentation: Segmentation, settings: PerceptionSettings
) -> tuple[View, Perceived]:
    """Find floor, object and scale; perceive.  Raises InvalidProblem."""
    floor = given.floor if given.floor is not None else find_floor(clip.frames)
    if floor is None:
        floor = lowest_row(segmentation.paint(clip.frames, float(clip.frames.shape[1])))
    frames = segmentation.paint(clip.frames, floor)
    scale = given.scale or UNKNOWN_SCALE
    tried: list[tuple[bool, float, int, View, Perceived]] = []
    for extent in EXTENTS:
        view = view_of(frames, scale=scale, floor=floor, extent=extent)
        seen = perceive(view.frames, view.camera, settings)
        tried.append((seen.status != "ok", seen.residual, len(tried), view, seen))
        if seen.status == "ok":
            break
    *_, view, seen = min(tried)
    shift = camera_shift(clip.frames, view.around(to_world(seen.poses, seen.vertices)))
    if shift > STEADY and seen.status == "ok":
        reason = f"the camera moves, by up to {shift:.1f} pixels: hold it still, or steady the video"
        seen = replace(seen, status="poor_fit", reason=reason)
    seen = simplified(seen, NEEDLESS * view.camera.scale)
    if given.object_size is None:
        return view, seen
    factor = given.object_size / diameter(seen.vertices)
    return view.scaled(factor), scaled(seen, factor)


def simplified(seen: Perceived, detail: float) -> Perceived:
    """Without corners that change the outline by less than `detail` [m], nor spikes twice as thin.

    Compression leaves errors along the outline that are no noise to perception, which explains them by needless corners, some
    of them in knots.
    """
    whole = shapely.Polygon(seen.vertices).buffer(0)
    open_ = whole.buffer(-detail, join_style="mitre").buffer(detail, join_style="mitre")
    largest = max(shapely.get_parts(whole if open_.is_empty else open_), key=shapely.area)
    plain = shapely.geometry.polygon.orient(largest.simplify(detail))
    vertices = np.array(plain.exterior.coords)[:-1]
    low = np.flatnonzero(vertices[:, 1] < vertices[:, 1].min() + detail)
    first = int(low[vertices[low, 0].argmin()])
    return replace(seen, vertices=np.roll(vertices, -first, axis=0))


def scaled(seen: Perceived, factor: float) -> Perceived:
    """The same, if the video's pixels were so many times as large."""
    return replace(seen, vertices=factor * seen.vertices, poses=seen.poses * [factor, factor, 1.0])


def resampled(seen: Perceived, clip: Clip, steps: int) -> Perceived:
    """Poses at `steps` equally spaced times; between frames, on a straight line."""
    times = np.linspace(0.0, clip.duration, steps)
    columns = [np.interp(times, clip.times, column) for column in seen.poses.T]
    return replace(seen, poses=np.column_stack(columns))


def tasks_of(tasks: TaskSettings, given: Given, clip: Clip) -> TaskSettings:
    """What planning assumes, with the given mass, friction and pace."""
    duration = clip.duration if given.duration is None else given.duration
    return replace(tasks, mass=given.mass, friction=given.friction, dt=duration / (tasks.steps - 1))
