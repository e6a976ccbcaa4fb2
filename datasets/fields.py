"""The fields of a stored sample: names, types, axes, and the way from a Sample to arrays and back."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from datasets.motions import TaskSettings
from datasets.parameters import EXTERNAL_CONTACTS, SCHEMA, MechanicalParameters
from datasets.specification import Sample
from expert.errors import InvalidProblem
from expert.problems.contact import ContactForce, Plan
from expert.world.motion import Trajectory
from expert.world.shape import Body

NO_VERTEX = -1
"""Vertex of an absent floor contact."""

PARAMETER = "parameter_"
"""Prefix of the fields that hold P(t)."""


@dataclass(frozen=True)
class Field:
    """kind: numpy's letter for the type.  axes: one letter each, as in AXES.  meaning: with its unit."""

    kind: str
    axes: str
    meaning: str


AXES = {
    "n": "sample",
    "t": "step",
    "y": "pixel row",
    "x": "pixel column",
    "k": "red, green, blue",
    "v": "vertex",
    "c": "finger",
    "e": "floor contact",
    "d": "x, y",
    "p": "x, y, theta",
    "w": "force x, force y, torque",
    "j": "end point or ray",
    "h": "half-plane",
    "b": "least, largest",
}

FIELDS = {
    "index": Field("i", "n", "number of the task"),
    "attempt": Field("i", "n", "draws that failed before it"),
    "family": Field("U", "n", "slide, pivot, lift, lift_rotate, slide_lift or pivot_lift"),
    "video": Field("u", "ntyxk", "frames, 0 to 255"),
    "poses": Field("f", "ntp", "desired motion of the centre of mass [m, m, rad], at rest before and after"),
    "dt": Field("f", "n", "time between steps [s]"),
    "vertices": Field("f", "nvd", "polygon, body frame, counter-clockwise, padded with zeros [m]"),
    "vertex_count": Field("i", "n", "how many of them count"),
    "mass": Field("f", "n", "[kg]"),
    "inertia": Field("f", "n", "about the centre of mass [kg m^2]"),
    "friction": Field("f", "n", "coefficient, fingers and floor"),
    "min_normal_force": Field(
        "f", "n", "least push that the plan was asked to keep [N]; 0 where it could not"
    ),
    "positions": Field("f", "ntcd", "fingers of the expert's plan, world frame [m]"),
    "forces": Field("f", "ntcd", "their forces on the object, world frame [N]"),
    "modes": Field("i", "ntc", "facet that each finger touches, -1: none"),
    "floor_vertices": Field("i", "nte", "vertices that the floor pushes, -1: no contact"),
    "floor_points": Field("f", "nted", "where it pushes [m]"),
    "floor_forces": Field("f", "nted", "its forces [N]"),
    "status": Field("U", "n", "optimal (gap certified) or feasible (node limit reached)"),
    "objective": Field("f", "n", "cost of the plan: sum |force|^2 + sum |acceleration|^2, SI"),
    "bound": Field("f", "n", "certified lower bound on the cost of any plan"),
    "nodes": Field("i", "n", "nodes of the search"),
    "residual": Field("f", "n", "largest Newton-Euler residual over m g and m g L"),
    **{
        PARAMETER + name: Field("f", f"nt{q.axes}", f"P(t): {q.meaning}" + (f" [{q.unit}]" if q.unit else ""))
        for name, q in SCHEMA.items()
    },
}


def arrays_of(samples: list[Sample], most_vertices: int) -> dict[str, np.ndarray[Any, Any]]:
    """Samples as arrays by field name, stacked along a first axis."""
    rows = [_row(sample, most_vertices) for sample in samples]
    return {name: np.stack([np.asarray(row[name]) for row in rows]) for name in FIELDS}


def _row(sample: Sample, most_vertices: int) -> dict[str, Any]:
    task, plan = sample.task, sample.plan
    vertices = np.zeros((most_vertices, 2))
    vertices[: len(task.body.vertices)] = task.body.vertices
    return {
        "index": sample.index,
        "attempt": sample.attempt,
        "family": np.array(sample.family, dtype="U16"),
        "video": sample.video,
        "poses": task.trajectory.poses,
        "dt": task.trajectory.dt,
        "vertices": vertices,
        "vertex_count": len(task.body.vertices),
        "mass": task.body.mass,
        "inertia": task.body.inertia,
        "friction": task.fingers.friction,
        "min_normal_force": task.robustness.min_normal_force,
        "positions": plan.positions,
        "forces": plan.forces,
        "modes": plan.modes,
        **_floor(plan, task.steps),
        "status": np.array(plan.status, dtype="U16"),
        "objective": plan.objective,
        "bound": plan.bound,
        "nodes": plan.nodes,
        "residual": plan.residual,
        **{PARAMETER + name: value for name, value in sample.parameters.named().items()},
    }


def _floor(plan: Plan, steps: int) -> dict[str, Any]:
    """The floor's forces, at most EXTERNAL_CONTACTS per step in the plan's order."""
    vertices = np.full((steps, EXTERNAL_CONTACTS), NO_VERTEX)
    points, forces = np.zeros((2, steps, EXTERNAL_CONTACTS, 2))
    taken = np.zeros(steps, dtype=int)
    for contact in plan.contact_forces:
        slot = contact.step, taken[contact.step]
        vertices[slot], points[slot], forces[slot] = contact.vertex, contact.point, contact.force
        taken[contact.step] += 1
    return {"floor_vertices": vertices, "floor_points": points, "floor_forces": forces}


def sample_of(row: Mapping[str, Any], tasks: TaskSettings) -> Sample:
    """The sample that `_row` was made of; `tasks` holds what all tasks of the data set share.

    Raises InvalidProblem where the stored numbers make no task.
    """
    body = Body(
        vertices=row["vertices"][: row["vertex_count"]],
        mass=float(row["mass"]),
        inertia=float(row["inertia"]),
    )
    motion = Trajectory.of(row["poses"], float(row["dt"]), "rest")
    weight = body.mass * tasks.gravity
    own = replace(
        tasks,
        mass=body.mass,
        friction=float(row["friction"]),
        least_push=float(row["min_normal_force"]) / weight,
    )
    return Sample(
        index=int(row["index"]),
        attempt=int(row["attempt"]),
        family=str(row["family"]),
        video=row["video"],
        task=own.task(body, motion),
        plan=_plan(row),
        parameters=MechanicalParameters(**{name: row[PARAMETER + name] for name in SCHEMA}),
    )


def _plan(row: Mapping[str, Any]) -> Plan:
    status = str(row["status"])
    if status != "optimal" and status != "feasible":
        raise InvalidProblem(f"sample {row['index']} status", expected="optimal or feasible", got=status)
    slots = np.argwhere(row["floor_vertices"] != NO_VERTEX)
    contacts = tuple(
        ContactForce(
            step=int(t),
            vertex=int(row["floor_vertices"][t, e]),
            wall=0,
            point=row["floor_points"][t, e],
            force=row["floor_forces"][t, e],
        )
        for t, e in slots
    )
    return Plan(
        status=status,  # type: ignore[arg-type]
        objective=float(row["objective"]),
        bound=float(row["bound"]),
        nodes=int(row["nodes"]),
        modes=row["modes"],
        positions=row["positions"],
        forces=row["forces"],
        contact_forces=contacts,
        residual=float(row["residual"]),
    )
