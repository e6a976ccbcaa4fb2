"""Files of `problem: push`: PushProblem and PushPlan to and from mappings."""

from typing import Any

from expert.files.objects import read_shape, write_shape
from expert.files.problem import Problem
from expert.files.section import Section, plain_keys, plain_values
from expert.files.walls import read_walls, write_walls
from expert.problems.push import (
    Finger,
    LimitSurface,
    Push,
    PushOptions,
    PushPlan,
    PushProblem,
    Tolerance,
)
from expert.world.walls import Obstacle

TASKS: tuple[type, ...] = (PushProblem,)
OPTIONS: type = PushOptions
KEYS: tuple[str, ...] = (
    "object",
    "limit_surface",
    "finger",
    "start",
    "goal",
    "tolerance",
    "obstacles",
    "workspace",
    "clearance",
    "options",
)
ANSWER_KEYS: tuple[str, ...] = (*plain_keys(PushPlan), "pushes")


def read(file: Section) -> tuple[PushProblem, dict[str, Any]]:
    """The task that a file describes and options for the solver.  Raises InvalidProblem."""
    surface = file.section("limit_surface", plain_keys(LimitSurface), optional=True)
    finger = file.section("finger", ("start", *plain_keys(Finger)))
    tolerance = file.section("tolerance", plain_keys(Tolerance), optional=True)
    task = PushProblem(
        shape=read_shape(file.section("object", ("vertices", "pieces"))),
        limit_surface=LimitSurface(**surface.values(LimitSurface)),
        finger=Finger(start=finger.array("start", (2,)), **finger.values(Finger)),
        start=file.array("start", (3,)),
        goal=file.array("goal", (3,)),
        tolerance=Tolerance(**tolerance.values(Tolerance)),
        obstacles=read_walls(file, "obstacles", (Obstacle,)),
        workspace=file.array("workspace", (4,)) if "workspace" in file else None,
        **file.values(PushProblem, ("clearance",)),
    )
    return task, file.section("options", plain_keys(OPTIONS), optional=True).values(OPTIONS)


def write(task: PushProblem) -> dict[str, Any]:
    """What `read` reads."""
    workspace = {} if task.workspace is None else {"workspace": task.workspace.tolist()}
    return {
        "object": write_shape(task.shape),
        "limit_surface": plain_values(task.limit_surface),
        "finger": {"start": task.finger.start.tolist(), **plain_values(task.finger)},
        "start": task.start.tolist(),
        "goal": task.goal.tolist(),
        "tolerance": plain_values(task.tolerance),
        "obstacles": write_walls(task.obstacles),
        "clearance": task.clearance,
        **workspace,
    }


def answer_fields(problem: Problem, answer: PushPlan) -> dict[str, Any]:
    """The plan as plain JSON values."""
    pushes = [{"way": p.way.tolist(), "end": p.end.tolist(), "pose": p.pose.tolist()} for p in answer.pushes]
    return {**plain_values(answer), "pushes": pushes}


def read_answer(problem: Problem, file: Section) -> PushPlan:
    """The plan of a solution file, checked for form (its truth is what `expert.verify.push.check` checks).  Raises InvalidProblem."""
    pushes = tuple(
        Push(way=push.array("way", (None, 2)), end=push.array("end", (2,)), pose=push.array("pose", (3,)))
        for push in file.sections("pushes", ("way", "end", "pose"))
    )
    return PushPlan(**file.values(PushPlan), pushes=pushes)
