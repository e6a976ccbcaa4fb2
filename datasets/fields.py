"""The fields of a stored sample: names, types, axes, and the way from a Sample to arrays and back.

Axes: n sample, t step, y and x pixel, k colour, v vertex (padded with zeros to the data set's largest polygon), c finger,
e contact with the floor, d coordinate, p pose (x, y, theta), j end point or ray, h region row, b bound.
"""

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any

import numpy as np

from datasets.motions import Tasks
from datasets.parameters import EXTERNAL_CONTACTS, MechanicalParameters
from datasets.specification import Sample
from expert.errors import InvalidProblem
from expert.types import Body, ContactForce, Plan, Trajectory

NO_VERTEX = -1
"""Vertex of an absent floor contact."""

PARAMETER = "parameter_"
"""Prefix of the fields that hold P(t); see MechanicalParameters for their meaning."""

PARAMETER_AXES = {
    "poses": "ntp",
    "wrench": "ntp",
    "facets": "ntcjd",
    "cones": "ntcjd",
    "contact": "ntc",
    "stick": "ntc",
    "force_limits": "ntcb",
    "region_normals": "ntchd",
    "region_offsets": "ntch",
    "external_points": "nted",
    "external_cones": "ntejd",
    "reference_positions": "ntcd",
    "reference_forces": "ntcd",
}

FIELDS: dict[str, tuple[str, str]] = {
    "index": ("i", "n"),
    "attempt": ("i", "n"),
    "family": ("U", "n"),
    "video": ("u", "ntyxk"),
    "poses": ("f", "ntp"),
    "dt": ("f", "n"),
    "vertices": ("f", "nvd"),
    "vertex_count": ("i", "n"),
    "mass": ("f", "n"),
    "inertia": ("f", "n"),
    "friction": ("f", "n"),
    "min_normal_force": ("f", "n"),
    "positions": ("f", "ntcd"),
    "forces": ("f", "ntcd"),
    "modes": ("i", "ntc"),
    "floor_vertices": ("i", "nte"),
    "floor_points": ("f", "nted"),
    "floor_forces": ("f", "nted"),
    "status": ("U", "n"),
    "objective": ("f", "n"),
    "bound": ("f", "n"),
    "nodes": ("i", "n"),
    "residual": ("f", "n"),
    **{PARAMETER + name: ("f", axes) for name, axes in PARAMETER_AXES.items()},
}
"""Kind of numpy type, and one letter per axis."""


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
        **{PARAMETER + f.name: getattr(sample.parameters, f.name) for f in fields(MechanicalParameters)},
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


def sample_of(row: Mapping[str, Any], tasks: Tasks) -> Sample:
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
        parameters=MechanicalParameters(
            **{f.name: row[PARAMETER + f.name] for f in fields(MechanicalParameters)}
        ),
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
