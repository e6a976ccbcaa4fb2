"""Files of `problem: cage`: CageProblem, or Arrangement where finger positions are given, and CageSolution to and from mappings."""

from typing import Any

import numpy as np

from expert.errors import InvalidProblem
from expert.files.grippers import read_grippers, write_grippers
from expert.files.objects import read_pose, read_shape, write_shape
from expert.files.problem import Problem
from expert.files.section import Section, checked_array, plain_keys, plain_values, shorten
from expert.files.walls import read_walls, write_walls
from expert.geometry.pose import Array
from expert.problems.cage import Arrangement, CageOptions, CageProblem, CageSolution, HalfRanges, Meeting
from expert.world.walls import Segment

TASKS: tuple[type, ...] = (CageProblem, Arrangement)
OPTIONS: type = CageOptions
KEYS: tuple[str, ...] = ("object", "pose", "fingers", "walls", "cost", "options")
ANSWER_KEYS: tuple[str, ...] = (*plain_keys(CageSolution), "fingers", "rotation_range", "topology")
_SEARCHED = ("count", "fewest", "parallel")
_FINGERS = (*_SEARCHED, "positions", "fixed", "grippers", "direction")


def read(file: Section) -> tuple[CageProblem | Arrangement, dict[str, Any]]:
    """The task that a file describes and options for the solver.  Raises InvalidProblem."""
    common: dict[str, Any] = {
        "shape": read_shape(file.section("object", ("vertices", "pieces"))),
        "pose": read_pose(file),
        "walls": read_walls(file, "walls", (Segment,)),
    }
    fingers = file.section("fingers", _FINGERS)
    fixed = fingers.array("fixed", (None, 2)) if "fixed" in fingers else np.empty((0, 2))
    options = file.section("options", ("margin", "rotation", *plain_keys(OPTIONS)), optional=True)
    if "positions" in fingers:
        return Arrangement(**common, fingers=np.concatenate([_read_positions(file, fingers), fixed])), {}
    problem = CageProblem(
        **common,
        fixed=fixed,
        grippers=read_grippers(fingers),
        direction=float(np.radians(fingers.number("direction"))) if "direction" in fingers else None,
        rotation=_read_rotation(options),
        **fingers.values(CageProblem, _SEARCHED),
        **file.values(CageProblem, ("cost",)),
        **options.values(CageProblem, ("margin",)),
    )
    return problem, options.values(OPTIONS)


def write(task: CageProblem | Arrangement) -> dict[str, Any]:
    """What `read` reads."""
    common = {
        "object": write_shape(task.shape),
        "pose": task.pose.tolist(),
        "walls": write_walls(task.walls),
    }
    if isinstance(task, Arrangement):
        return {**common, "fingers": {"positions": task.fingers.tolist()}}
    fingers = {"fixed": task.fixed.tolist(), "grippers": write_grippers(task.grippers)}
    if task.direction is not None:
        fingers["direction"] = float(np.degrees(task.direction))
    rotation = np.degrees(task.rotation).tolist() if task.rotation else "auto"
    return {
        **common,
        "fingers": {**plain_values(task, _SEARCHED), **fingers},
        "cost": task.cost,
        "options": {"margin": task.margin, "rotation": rotation},
    }


def _read_positions(file: Section, fingers: Section) -> Array:
    """Given fingers; beside them there is nothing to search for."""
    for key in ("count", "fewest", "grippers", "parallel", "direction"):
        if key in fingers:
            raise InvalidProblem(
                fingers.path(key), expected="nothing beside positions", got="both", remedy="remove one"
            )
    if "cost" in file or "options" in file:
        raise InvalidProblem("cost, options", expected="nothing where positions are given", got="both")
    return fingers.array("positions", (None, 2))


def _read_rotation(options: Section) -> HalfRanges:
    """Half-ranges [deg] in a list, each a number for both sides or a pair [below, above]; `auto`: the default ladder."""
    value = options.data.get("rotation", "auto")
    if value in ("auto", None):
        return ()
    field = options.path("rotation")
    if not isinstance(value, list) or not value:
        raise InvalidProblem(field, expected="auto or a list of half-ranges in degrees", got=shorten(value))
    pairs = [
        checked_array(item if isinstance(item, list) else [item, item], (2,), f"{field}[{k}]")
        for k, item in enumerate(value)
    ]
    return tuple((float(np.radians(below)), float(np.radians(above))) for below, above in pairs)


def answer_fields(problem: Problem, answer: CageSolution) -> dict[str, Any]:
    """The answer as plain JSON values; rotation_range null where the object may turn freely."""
    limits = answer.rotation_range
    return {
        **plain_values(answer),
        "fingers": answer.fingers.tolist(),
        "rotation_range": list(limits) if limits is not None and np.isfinite(limits).all() else None,
        "topology": [plain_values(meeting) for meeting in answer.topology],
    }


def read_answer(problem: Problem, file: Section) -> CageSolution:
    """The answer of a solution file, checked for form (its truth is what `expert.verify.cage.check` checks)."""
    summary = file.values(CageSolution)
    if isinstance(problem.task, Arrangement):
        raise InvalidProblem("problem.fingers", expected="count", got="positions: nothing to solve")
    limits = file.array("rotation_range", (2,)).tolist() if "rotation_range" in file else None
    return CageSolution(
        **summary,
        fingers=_read_fingers(file, problem.task) if summary["status"] == "caged" else np.empty((0, 2)),
        rotation_range=tuple(limits) if limits else None,
        topology=tuple(
            Meeting(**meeting.values(Meeting)) for meeting in file.sections("topology", plain_keys(Meeting))
        ),
    )


def _read_fingers(file: Section, task: CageProblem) -> Array:
    """As many as the problem searched for, or at most so many where it asked for the fewest."""
    if not task.fewest:
        return file.array("fingers", (task.count, 2))
    fingers = file.array("fingers", (None, 2))
    if len(fingers) > task.count:
        what = f"at most {task.count} fingers"
        raise InvalidProblem(file.path("fingers"), expected=what, got=str(len(fingers)))
    return fingers
