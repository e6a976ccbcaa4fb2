"""Files of `problem: certified_grasp`: GraspProblem and GraspSolution to and from mappings.

Facets are numbered as the problem file lists its vertices, either way round; inside the package counter-clockwise.
"""

from typing import Any

import numpy as np

from expert.errors import InvalidProblem
from expert.files.grippers import read_grippers, write_grippers
from expert.files.objects import Numbering, read_pose, read_shape, write_shape
from expert.files.problem import Problem
from expert.files.section import Section, plain_keys, plain_values, shorten
from expert.geometry.pose import Array
from expert.problems.grasp import LAST_RANGE, GraspOptions, GraspProblem, GraspSolution, schedule

TASKS: tuple[type, ...] = (GraspProblem,)
OPTIONS: type = GraspOptions
KEYS: tuple[str, ...] = ("object", "pose", "fingers", "cost", "options")
ANSWER_KEYS: tuple[str, ...] = (*plain_keys(GraspSolution), "path", "facets", "starts")
_FINGERS = ("count", "parallel")


def read(file: Section) -> tuple[GraspProblem, dict[str, Any]]:
    """The task that a file describes and options for the solver.  Raises InvalidProblem."""
    shape = read_shape(file.section("object", ("vertices",)))
    fingers = file.section("fingers", ("grippers", *_FINGERS), optional=True)
    options = file.section("options", ("half_ranges", "margin", *plain_keys(OPTIONS)), optional=True)
    ranges: dict[str, Any] = {"half_ranges": _read_half_ranges(options)} if "half_ranges" in options else {}
    problem = GraspProblem(
        shape=shape,
        pose=read_pose(file),
        grippers=read_grippers(fingers),
        **ranges,
        **fingers.values(GraspProblem, _FINGERS),
        **file.values(GraspProblem, ("cost",)),
        **options.values(GraspProblem, ("margin",)),
    )
    return problem, options.values(OPTIONS)


def write(task: GraspProblem) -> dict[str, Any]:
    """What `read` reads."""
    options = {"half_ranges": np.degrees(task.half_ranges).tolist(), "margin": task.margin}
    return {
        "object": write_shape(task.shape),
        "pose": task.pose.tolist(),
        "fingers": {**plain_values(task, _FINGERS), "grippers": write_grippers(task.grippers)},
        "cost": task.cost,
        "options": options,
    }


def _read_half_ranges(options: Section) -> Array:
    """Radians, from degrees: a list, or the first one of the usual schedule."""
    if isinstance(options.data["half_ranges"], list):
        return np.radians(options.array("half_ranges", (None,)))
    first = options.number("half_ranges")
    if not first > 4 * LAST_RANGE:
        raise InvalidProblem(
            options.path("half_ranges"),
            expected=f"more than {4 * LAST_RANGE:g} degrees",
            got=f"{first:g}",
            remedy="list all half-ranges for a narrower schedule",
        )
    return np.radians(schedule(first))


def answer_fields(problem: Problem, answer: GraspSolution) -> dict[str, Any]:
    """The answer as plain JSON values."""
    facets = Numbering.of(problem.data).facets(np.array(answer.facets, dtype=np.int64))
    return {
        **plain_values(answer),
        "path": answer.path.tolist(),
        "facets": facets.tolist(),
        "starts": answer.starts.tolist(),
    }


def read_answer(problem: Problem, file: Section) -> GraspSolution:
    """The answer of a solution file, checked for form (its truth is what `expert.verify.grasp.check` checks)."""
    summary, task = file.values(GraspSolution), problem.task
    path = np.empty((0, task.count, 2))
    if summary["status"] in ("certified", "uncertified") or file.data.get("path"):
        path = file.array("path", (len(task.half_ranges), task.count, 2))
    return GraspSolution(
        **summary,
        path=path,
        facets=_read_facets(file, problem) if len(path) else (),
        starts=file.array("starts", (None, 2)) if file.data.get("starts") else np.empty((0, 2)),
    )


def _read_facets(file: Section, problem: Problem) -> tuple[int, ...]:
    """One facet index per finger; an empty list where the method names none."""
    listed, count, numbering = file.data.get("facets", []), problem.task.count, Numbering.of(problem.data)
    if not isinstance(listed, list) or len(listed) not in (0, count):
        raise InvalidProblem("facets", expected=f"a list of {count} facet indices", got=shorten(listed))
    for n, facet in enumerate(listed):
        if type(facet) is not int or not 0 <= facet < numbering.count:
            what = f"a facet index from 0 to {numbering.count - 1}"
            raise InvalidProblem(f"facets[{n}]", expected=what, got=shorten(facet))
    return tuple(numbering.facets(np.array(listed, dtype=np.int64)).tolist())
