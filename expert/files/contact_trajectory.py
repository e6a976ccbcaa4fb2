"""Files of `problem: contact_trajectory`: ContactTask and Plan to and from mappings.

The file's body frame may have any origin and list its vertices either way round.  Inside the package the origin is the
centre of mass and the order counter-clockwise: converted here, once.
"""

from typing import Any, get_args

import numpy as np

from expert.errors import InvalidProblem
from expert.files.objects import Numbering, read_body, write_body
from expert.files.problem import Problem
from expert.files.section import Section, jsonable, plain_keys, plain_values, shorten
from expert.files.walls import read_walls, write_walls
from expert.geometry.pose import Array, moved_origin, to_world
from expert.problems.contact import (
    FREE,
    SUPPORT,
    ContactForce,
    ContactOptions,
    ContactTask,
    Cost,
    Plan,
    Robustness,
    Stated,
)
from expert.world.environment import Environment
from expert.world.fingers import Fingers
from expert.world.motion import Ends, Trajectory
from expert.world.values import IntArray
from expert.world.walls import HalfPlane

TASKS: tuple[type, ...] = (ContactTask,)
OPTIONS: type = ContactOptions
KEYS: tuple[str, ...] = ("object", "environment", "trajectory", "fingers", "cost", "robustness", "options")
ANSWER_KEYS: tuple[str, ...] = (
    *plain_keys(Plan),
    "gap",
    "modes",
    "finger_positions",
    "finger_forces",
    "contact_forces",
    "certificate",
)
FORCE_LIMIT = 10
"""Largest force of a finger over m g, where a file states none."""


def read(file: Section) -> tuple[ContactTask, dict[str, Any]]:
    """The task that a file describes and options for the solver.  Raises InvalidProblem."""
    body, com = read_body(file.section("object", ("vertices", "mass", "com", "inertia")))
    surroundings = file.section("environment", ("walls", *plain_keys(Environment)))
    walls = read_walls(surroundings, "walls", (HalfPlane,))
    environment = Environment(walls=walls, **surroundings.values(Environment))
    motion = file.section("trajectory", ("dt", "poses", "ends", "before", "after"))
    fingers = file.section("fingers", plain_keys(Fingers))
    largest = FORCE_LIMIT * body.mass * environment.gravity
    cost = file.section("cost", plain_keys(Cost), optional=True)
    robustness = file.section("robustness", plain_keys(Robustness), optional=True)
    task = ContactTask(
        body=body,
        environment=environment,
        trajectory=_read_trajectory(motion, com),
        fingers=Fingers(**fingers.values(Fingers, max_force=largest)),
        cost=Cost(**cost.values(Cost)),
        robustness=Robustness(**robustness.values(Robustness)),
    )
    return task, file.section("options", plain_keys(OPTIONS), optional=True).values(OPTIONS)


def write(task: ContactTask) -> dict[str, Any]:
    """What `read` reads; lengths and poses refer to the task's own body frame, whose origin is the centre of mass."""
    path, walls = task.trajectory, write_walls(task.environment.walls)
    return {
        "object": write_body(task.body),
        "environment": {**plain_values(task.environment), "walls": walls},
        "trajectory": {"dt": path.dt} | {k: getattr(path, k).tolist() for k in ("poses", "before", "after")},
        "fingers": plain_values(task.fingers),
        "cost": plain_values(task.cost),
        "robustness": plain_values(task.robustness),
    }


def _read_trajectory(section: Section, com: Array) -> Trajectory:
    """Poses of the centre of mass; the end rule applies to its motion."""
    poses = moved_origin(section.array("poses", (None, 3)), com)
    if len(poses) < 2:
        raise InvalidProblem(section.path("poses"), expected="at least 2 poses", got=f"{len(poses)}")
    rule: Any = {"ends": section.choice("ends", get_args(Ends))} if "ends" in section else {}
    by_rule = Trajectory.of(poses, section.number("dt", positive=True), **rule)
    outside = {
        key: moved_origin(section.array(key, (3,)), com) if key in section else getattr(by_rule, key)
        for key in ("before", "after")
    }
    return Trajectory(dt=by_rule.dt, poses=by_rule.poses, **outside)


def answer_fields(problem: Problem, answer: Plan) -> dict[str, Any]:
    """The plan as plain JSON values, facets and vertices numbered as in the problem file; null where there is none."""
    numbering = Numbering.of(problem.data)
    summary = {**plain_values(answer), "gap": jsonable(answer.gap)}
    if answer.certificate is not None:
        summary["certificate"] = answer.certificate
    if not answer.found:
        return summary
    return {
        **summary,
        "modes": [[None if f == FREE else f for f in row] for row in numbering.facets(answer.modes).tolist()],
        "finger_positions": answer.positions.tolist(),
        "finger_forces": answer.forces.tolist(),
        "contact_forces": [
            {
                "step": c.step,
                "vertex": numbering.vertex(c.vertex),
                "wall": None if c.wall == SUPPORT else c.wall,
                "point": c.point.tolist(),
                "force": c.force.tolist(),
            }
            for c in answer.contact_forces
        ],
    }


def read_answer(problem: Problem, file: Section) -> Plan:
    """The plan of a solution file, checked for form (its truth is what `expert.verify` checks).  Raises InvalidProblem."""
    summary, task, numbering = file.values(Plan), problem.task, Numbering.of(problem.data)
    summary["certificate"] = _read_certificate(file)
    gap = file.number("gap") if "gap" in file else np.nan
    summary["stated"] = Stated(gap=gap, asked=problem.options["gap"])
    if summary["status"] not in ("optimal", "feasible"):
        return Plan(**summary)
    shape = (task.steps, task.fingers.count, 2)
    return Plan(
        **summary,
        modes=numbering.facets(_read_modes(file, shape[:2], numbering.count)),
        positions=file.array("finger_positions", shape),
        forces=file.array("finger_forces", shape),
        contact_forces=tuple(
            _read_contact(section, task, numbering)
            for section in file.sections("contact_forces", ("step", "vertex", "wall", "point", "force"))
        ),
    )


def _read_certificate(file: Section) -> dict[str, Any] | None:
    """As it is: what it proves is the checker's business."""
    if "certificate" not in file:
        return None
    found = file.take("certificate", "a mapping")
    if not isinstance(found, dict):
        raise InvalidProblem(file.path("certificate"), expected="a mapping", got=shorten(found))
    return found


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


def _read_contact(section: Section, task: ContactTask, numbering: Numbering) -> ContactForce:
    """One environment force; where no point is given it acts at the vertex."""
    step = _index(section, "step", task.steps)
    vertex = numbering.vertex(_index(section, "vertex", numbering.count))
    wall = _index(section, "wall", len(task.environment.walls)) if "wall" in section else SUPPORT
    at_vertex = to_world(task.trajectory.poses[step], task.body.vertices)[vertex]
    point = section.array("point", (2,)) if "point" in section else at_vertex
    return ContactForce(step=step, vertex=vertex, wall=wall, point=point, force=section.array("force", (2,)))


def _index(section: Section, key: str, count: int) -> int:
    index = section.integer(key)
    if index >= count:
        raise InvalidProblem(section.path(key), expected=f"an index from 0 to {count - 1}", got=f"{index}")
    return index
