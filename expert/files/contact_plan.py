"""Plans in solution files of `problem: contact_trajectory`: Plan -> mapping and back.

Facets and vertices are numbered as the problem file lists them, either way round; inside the package counter-clockwise.
"""

from typing import TYPE_CHECKING, Any

import numpy as np

from expert.errors import InvalidProblem
from expert.files.fields import Section, shorten
from expert.geometry.polygon import signed_area
from expert.geometry.pose import to_world
from expert.problems.contact import FREE, SUPPORT, ContactForce, ContactTask, Plan, Status
from expert.world.values import IntArray

if TYPE_CHECKING:
    from expert.files import Problem

STATUSES: tuple[Status, ...] = ("optimal", "feasible", "infeasible", "time_limit")


def answer_fields(problem: "Problem", plan: Plan) -> dict[str, Any]:
    """The plan as plain JSON values, facets and vertices numbered as in the problem file; null where there is none."""
    numbering = _Numbering(problem)
    summary = {
        "status": plan.status,
        "objective": _number(plan.objective),
        "bound": _number(plan.bound),
        "gap": _number(plan.gap),
        "seconds": plan.seconds,
        "nodes": plan.nodes,
    }
    if not plan.found:
        return {**summary, "reason": plan.reason}
    return {
        **summary,
        "modes": [[None if f == FREE else f for f in row] for row in numbering.facets(plan.modes).tolist()],
        "finger_positions": plan.positions.tolist(),
        "finger_forces": plan.forces.tolist(),
        "contact_forces": [
            {
                "step": c.step,
                "vertex": numbering.vertex(c.vertex),
                "wall": None if c.wall == SUPPORT else c.wall,
                "point": c.point.tolist(),
                "force": c.force.tolist(),
            }
            for c in plan.contact_forces
        ],
        "residual": _number(plan.residual),
        "reason": plan.reason,
    }


def read_answer(problem: "Problem", data: dict[str, Any]) -> Plan:
    """The plan of a solution file, checked for form (its truth is what `expert.verify` checks).  Raises InvalidProblem."""
    keys = (
        "status",
        "objective",
        "bound",
        "gap",
        "seconds",
        "nodes",
        "modes",
        "finger_positions",
        "finger_forces",
    )
    file = Section(data, "", (*keys, "contact_forces", "residual", "reason"))
    status: Any = file.choice("status", STATUSES)
    summary = {
        "status": status,
        "objective": file.number("objective", np.inf),
        "bound": file.number("bound", -np.inf),
        "seconds": file.number("seconds", 0.0),
        "nodes": file.integer("nodes", 0),
        "residual": file.number("residual", np.nan),
        "reason": file.text("reason", ""),
    }
    if status not in ("optimal", "feasible"):
        return Plan(**summary)
    numbering, task = _Numbering(problem), problem.task
    shape = (task.steps, task.fingers.count, 2)
    return Plan(
        **summary,
        modes=numbering.facets(_read_modes(file, shape[:2], len(task.body.vertices))),
        positions=file.array("finger_positions", shape),
        forces=file.array("finger_forces", shape),
        contact_forces=tuple(
            _read_contact(section, task, numbering)
            for section in file.sections("contact_forces", ("step", "vertex", "wall", "point", "force"))
        ),
    )


class _Numbering:
    """Facets and vertices of a file that lists them clockwise, to and from the package's counter-clockwise ones."""

    def __init__(self, problem: "Problem") -> None:
        listed = np.array(problem.data["object"]["vertices"], dtype=float)
        self.count, self.clockwise = len(listed), signed_area(listed) < 0

    def vertex(self, index: int) -> int:
        """Either way: the conversion is its own inverse."""
        return -index % self.count if self.clockwise else index

    def facets(self, modes: IntArray) -> IntArray:
        """Either way, FREE kept."""
        return np.where(modes == FREE, FREE, self.count - 1 - modes) if self.clockwise else modes


def _read_modes(file: Section, shape: tuple[int, int], facets: int) -> IntArray:
    field, rows = file.path("modes"), file.take("modes", "facets by step and finger")
    if not isinstance(rows, list) or len(rows) != shape[0]:
        raise InvalidProblem(field, expected=f"a list of {shape[0]} lists", got=shorten(rows))
    for t, row in enumerate(rows):
        valid = isinstance(row, list) and len(row) == shape[1]
        if not valid or not all(f is None or (type(f) is int and 0 <= f < facets) for f in row):
            what = f"{shape[1]} facets from 0 to {facets - 1}, or null"
            raise InvalidProblem(f"{field}[{t}]", expected=what, got=shorten(row))
    return np.array([[FREE if f is None else f for f in row] for row in rows], dtype=np.int64)


def _read_contact(section: Section, task: ContactTask, numbering: _Numbering) -> ContactForce:
    """One environment force; where no point is given it acts at the vertex."""
    step = _index(section, "step", task.steps)
    vertex = numbering.vertex(_index(section, "vertex", len(task.body.vertices)))
    wall = _index(section, "wall", len(task.environment.walls)) if "wall" in section else SUPPORT
    at_vertex = to_world(task.trajectory.poses[step], task.body.vertices)[vertex]
    point = section.array("point", (2,)) if "point" in section else at_vertex
    return ContactForce(step=step, vertex=vertex, wall=wall, point=point, force=section.array("force", (2,)))


def _index(section: Section, key: str, count: int) -> int:
    index = section.integer(key)
    if index >= count:
        raise InvalidProblem(section.path(key), expected=f"an index from 0 to {count - 1}", got=f"{index}")
    return index


def _number(value: float) -> float | None:
    """JSON knows neither infinity nor nan."""
    return float(value) if np.isfinite(value) else None
