"""Files of `problem: certified_grasp`: mapping -> GraspProblem; GraspSolution <-> mapping.

Facets are numbered as the problem file lists its vertices, either way round; inside the package counter-clockwise.
"""

from typing import TYPE_CHECKING, Any

import numpy as np

from expert.errors import InvalidProblem
from expert.files.cage import read_flag, read_grippers, require_size
from expert.files.fields import Section, checked_array, shorten
from expert.geometry.polygon import signed_area
from expert.geometry.pose import Array
from expert.problems.grasp import GraspProblem, GraspSolution, GraspStatus
from expert.world.shape import Shape

if TYPE_CHECKING:
    from expert.files import Problem

METHODS = ("goal_cell", "decomposed", "miqp1", "miqp2")
COSTS = ("attraction", "acceleration")
STATUSES: tuple[GraspStatus, ...] = ("certified", "uncertified", "none_found", "time_limit")
DEFAULT_RANGE, LAST_RANGE = 15.0, 0.5
"""Of the schedule of half-ranges [deg] that a single number stands for."""


def read(data: dict[str, Any]) -> tuple[GraspProblem, dict[str, Any]]:
    """The task that a file describes and keyword options for the solver.  Raises InvalidProblem."""
    file = Section(
        data, "", ("schema", "problem", "description", "object", "pose", "fingers", "cost", "options")
    )
    file.text("description", "")
    vertices = file.section("object", ("vertices",)).array("vertices", (None, 2))
    require_size("object.vertices", vertices)
    fingers = file.section("fingers", ("count", "grippers", "parallel"), optional=True)
    options = file.section("options", ("half_ranges", "margin", "time_limit", "method"), optional=True)
    problem = GraspProblem(
        shape=Shape(vertices=vertices),
        pose=file.array("pose", (3,)) if "pose" in file else np.zeros(3),
        count=fingers.integer("count", 4),
        grippers=read_grippers(fingers),
        parallel=read_flag(fingers, "parallel"),
        half_ranges=np.radians(_read_half_ranges(options)),
        cost=file.choice("cost", COSTS, "attraction"),  # type: ignore[arg-type]
        margin=options.number("margin", 0.001),
    )
    return problem, {
        "time_limit": options.number("time_limit", 60.0, positive=True),
        "method": options.choice("method", METHODS, "goal_cell"),
    }


def schedule(first: float) -> Array:
    """The default half-ranges [deg] for the largest of them: equal steps down to a quarter, then LAST_RANGE."""
    return np.array([first, 0.75 * first, 0.5 * first, 0.25 * first, LAST_RANGE])


def _read_half_ranges(options: Section) -> Array:
    """Degrees: a list, or the first one of the default schedule."""
    value = options.data.get("half_ranges")
    if value is None:
        return schedule(DEFAULT_RANGE)
    if isinstance(value, list):
        return checked_array(value, (None,), options.path("half_ranges"))
    first = options.number("half_ranges")
    if not first > 4 * LAST_RANGE:
        raise InvalidProblem(
            options.path("half_ranges"),
            expected=f"more than {4 * LAST_RANGE:g} degrees",
            got=f"{first:g}",
            remedy="list all half-ranges for a narrower schedule",
        )
    return schedule(first)


def answer_fields(problem: "Problem", answer: GraspSolution) -> dict[str, Any]:
    """The answer as plain JSON values."""
    return {
        "status": answer.status,
        "method": answer.method,
        "path": answer.path.tolist(),
        "facets": [_renumbered(problem, facet) for facet in answer.facets],
        "starts": answer.starts.tolist(),
        "objective": float(answer.objective) if np.isfinite(answer.objective) else None,
        "seconds": answer.seconds,
        "refuted": answer.refuted,
        "reason": answer.reason,
    }


def read_answer(problem: "Problem", data: dict[str, Any]) -> GraspSolution:
    """The answer of a solution file, checked for form (its truth is what `expert.verify.grasp.check` checks)."""
    keys = ("status", "method", "path", "facets", "starts", "objective", "seconds", "refuted", "reason")
    file = Section(data, "", keys)
    task: GraspProblem = problem.task
    status: Any = file.choice("status", STATUSES)
    path = np.empty((0, task.count, 2))
    if status in ("certified", "uncertified") or file.data.get("path"):
        path = file.array("path", (len(task.half_ranges), task.count, 2))
    return GraspSolution(
        status=status,
        path=path,
        facets=_read_facets(file, problem) if len(path) else (),
        starts=file.array("starts", (None, 2)) if file.data.get("starts") else np.empty((0, 2)),
        objective=file.number("objective", np.nan),
        method=file.text("method", ""),
        seconds=file.number("seconds", 0.0),
        refuted=file.integer("refuted", 0),
        reason=file.text("reason", ""),
    )


def _read_facets(file: Section, problem: "Problem") -> tuple[int, ...]:
    """One facet index per finger; an empty list where the method names none."""
    listed = file.data.get("facets", [])
    task: GraspProblem = problem.task
    facets = len(task.shape.vertices)
    if not isinstance(listed, list) or len(listed) not in (0, task.count):
        raise InvalidProblem("facets", expected=f"a list of {task.count} facet indices", got=shorten(listed))
    for n, facet in enumerate(listed):
        if isinstance(facet, bool) or not isinstance(facet, int) or not 0 <= facet < facets:
            raise InvalidProblem(
                f"facets[{n}]", expected=f"a facet index from 0 to {facets - 1}", got=shorten(facet)
            )
    return tuple(_renumbered(problem, facet) for facet in listed)


def _renumbered(problem: "Problem", facet: int) -> int:
    """From the file's numbering to the package's, and back by the same rule."""
    listed = np.array(problem.data["object"]["vertices"], dtype=float)
    return -(facet + 1) % len(listed) if signed_area(listed) < 0 else int(facet)
