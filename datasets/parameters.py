"""Mechanical parameters P(t) of a task (Thesis 4-CT4): all that the inverse dynamics must know to find the expert's plan."""

import itertools
from dataclasses import dataclass
from typing import Annotated, Generic, TypeVar

import numpy as np

from expert.errors import InvalidProblem
from expert.geometry.pose import Array
from expert.mechanics import (
    ExternalContact,
    external_contacts,
    friction_rays,
    inertial_wrench,
    region_rows,
    rho_limits,
    wall_rows,
)
from expert.problems.contact import FREE, ContactTask, Plan
from expert.world.values import IntArray, require

T = TypeVar("T")

EXTERNAL_CONTACTS = 2
REGION_ROWS = 4
NO_ROW = 1.0
"""Offset [m] of an empty region row, 0 . p <= 1: never active."""


@dataclass(frozen=True)
class Quantity:
    """What one field of P is at a step.

    axes: one letter each: c finger, e external contact, h region row, j end point or ray, d x and y, p pose, w wrench,
    b least and largest.  unit: of all numbers, or one for each entry of the last axis.  flag: 0 or 1; what a network predicts may
    be anything between.  where: the field without which this one is a filler: a flag that is 0, or rows of zeros.
    """

    axes: str
    meaning: str
    unit: str = ""
    flag: bool = False
    where: str = ""


@dataclass(frozen=True, kw_only=True)
class Parameters(Generic[T]):
    """P(t) (Thesis 4-CT4), SI, world frame: the one statement of its fields, in the order that everybody uses.

    Arrays begin with a step axis t, batches of tensors with task and step.  Facets less margin and wall clearance have the same
    fractions over one contact interval; a free finger keeps its nearest interval's facet, which moves with the object.  Cones are
    tightened as the expert's; both rays of a sliding ground contact are the same.  Fillers: empty region rows are 0 . p <= 1,
    absent ground contacts zero rays at the centre of mass.
    """

    poses: Annotated[T, Quantity("p", "motion r(t) of the centre of mass", "m, m, rad")]
    wrench: Annotated[T, Quantity("w", "M r_ddot + G, what all contacts together exert", "N, N, N m")]
    facets: Annotated[T, Quantity("cjd", "segment open to the finger", "m", where="contact")]
    cones: Annotated[T, Quantity("cjd", "edges of its friction cone, unit normal component", where="contact")]
    contact: Annotated[T, Quantity("c", "1 where the finger touches", flag=True)]
    stick: Annotated[
        T, Quantity("c", "1 where it stays at its place to the next step, and so may push", flag=True)
    ]
    force_limits: Annotated[T, Quantity("cb", "normal force of a pushing finger", "N")]
    region_normals: Annotated[
        T, Quantity("chd", "half-planes A p <= b that a free finger keeps to: A", where="region_normals")
    ]
    region_offsets: Annotated[T, Quantity("ch", "and b", "m", where="region_normals")]
    external_contact: Annotated[T, Quantity("e", "1 where the object touches the floor", flag=True)]
    external_points: Annotated[T, Quantity("ed", "where", "m", where="external_contact")]
    external_cones: Annotated[
        T, Quantity("ejd", "rays of the floor's forces, unit normal component", where="external_contact")
    ]
    reference_positions: Annotated[T, Quantity("cd", "where the torque is linearised: positions", "m")]
    reference_forces: Annotated[T, Quantity("cd", "and forces", "N")]

    def named(self) -> dict[str, T]:
        """All fields by name, in their order."""
        return {name: getattr(self, name) for name in SCHEMA}


SCHEMA: dict[str, Quantity] = {
    name: kind.__metadata__[0] for name, kind in Parameters.__annotations__.items()
}
"""Every field of P by name."""


def field_shapes(
    fingers: int, rows: int = REGION_ROWS, external: int = EXTERNAL_CONTACTS
) -> dict[str, tuple[int, ...]]:
    """Shape of each field at one step."""
    sizes = {"c": fingers, "h": rows, "e": external, "p": 3, "w": 3, "j": 2, "d": 2, "b": 2}
    return {name: tuple(sizes[axis] for axis in q.axes) for name, q in SCHEMA.items()}


@dataclass(frozen=True, kw_only=True)
class MechanicalParameters(Parameters[Array]):
    """P(t) of one task, as read-only arrays (t, ...).  Raises InvalidProblem for other shapes, and for nan or inf."""

    def __post_init__(self) -> None:
        steps, fingers = np.shape(self.contact)
        rows, external = np.shape(self.region_offsets)[-1], np.shape(self.external_points)[-2]
        for name, shape in field_shapes(fingers, rows, external).items():
            value = np.array(getattr(self, name), dtype=float)
            require(value.shape == (steps, *shape), name, f"shape {(steps, *shape)}", value.shape)
            require(bool(np.isfinite(value).all()), name, "finite numbers", "nan or inf")
            value.setflags(write=False)
            object.__setattr__(self, name, value)


def parameters_of(task: ContactTask, plan: Plan, *, rows: int = REGION_ROWS) -> MechanicalParameters:
    """Everything that the expert imposes on `plan`, so that 4-CT6 at these parameters has the plan as its optimum.

    Raises InvalidProblem for what the parameters cannot carry: the transverse plane, no plan, a cone-margin cost,
    more than two external contacts at a step, regions of more than `rows` half-planes.
    """
    _check_expressible(task, plan)
    facet, touching = contact_facets(plan.modes), plan.modes != FREE
    normals, offsets = _free_rows(task, plan, rows)
    present, points, external_cones = _external(task)
    return MechanicalParameters(
        poses=task.trajectory.poses,
        wrench=inertial_wrench(task),
        facets=_open_segments(task, facet, plan.modes),
        cones=_finger_cones(task, facet),
        contact=touching,
        stick=sticking(plan.modes),
        force_limits=np.broadcast_to(
            [task.robustness.min_normal_force, task.fingers.max_force], (*touching.shape, 2)
        ),
        region_normals=normals,
        region_offsets=offsets,
        external_contact=present,
        external_points=points,
        external_cones=external_cones,
        reference_positions=plan.positions,
        reference_forces=plan.forces,
    )


def _check_expressible(task: ContactTask, plan: Plan) -> None:
    require(
        task.environment.plane == "sagittal",
        "environment.plane",
        "sagittal",
        task.environment.plane,
        "support friction is not part of P",
    )
    require(plan.found, "plan.status", "optimal or feasible", plan.status)
    require(task.cost.margin == 0, "cost.margin", "0", task.cost.margin, "the QP has no cone-margin reward")


def sticking(modes: IntArray) -> Array:
    """1 where a finger touches the same facet at the next step too; the last step counts as held.  (T, C)"""
    held = np.concatenate([modes[1:] == modes[:-1], np.ones((1, modes.shape[1]), dtype=bool)])
    return (held & (modes != FREE)).astype(float)


def contact_facets(modes: IntArray) -> IntArray:
    """Modes with FREE replaced by the facet of the nearest contact in time (the earlier one of two); facet 0 if there is none."""
    filled = np.zeros_like(modes)
    for c, mode in enumerate(modes.T):
        touching = np.flatnonzero(mode != FREE)
        if len(touching):
            nearest = np.abs(np.arange(len(mode))[:, None] - touching).argmin(axis=1)
            filled[:, c] = mode[touching[nearest]]
    return filled


def intervals(mode: IntArray) -> list[slice]:
    """Maximal runs of equal entries."""
    cuts = np.flatnonzero(np.diff(mode)) + 1
    bounds = [0, *map(int, cuts), len(mode)]
    return [slice(a, b) for a, b in itertools.pairwise(bounds)]


def _open_segments(task: ContactTask, facet: IntArray, modes: IntArray) -> Array:
    """Facets (T, C, 2, 2) less what margin and walls close; in a contact interval, what any of its steps closes."""
    ends = task.body.facets_w(task.trajectory.poses)  # each (T, V, 2)
    a, b = (np.take_along_axis(x, facet[..., None], axis=1) for x in ends)
    low, high = (np.take_along_axis(x, facet, axis=1) for x in rho_limits(task, *ends))
    free = modes == FREE
    low[free], high[free] = task.fingers.facet_margin, 1 - task.fingers.facet_margin
    for c, mode in enumerate(modes.T):
        for run in intervals(mode):
            low[run, c], high[run, c] = low[run, c].max(), high[run, c].min()
    return np.stack([a + rho[..., None] * (b - a) for rho in (low, high)], axis=2)


def _finger_cones(task: ContactTask, facet: IntArray) -> Array:
    normal, _ = task.body.frames_w(task.trajectory.poses)  # (T, V, 2)
    chosen = np.take_along_axis(normal, facet[..., None], axis=1)
    return friction_rays(chosen, task.robustness.cone_fraction * task.fingers.friction)


def _free_rows(task: ContactTask, plan: Plan, rows: int) -> tuple[Array, Array]:
    """Half-planes (T, C, rows, 2), (T, C, rows) of each free finger: the free region it is in, and the walls."""
    normals = np.zeros((*plan.modes.shape, rows, 2))
    offsets = np.full((*plan.modes.shape, rows), NO_ROW)
    regions, walls = region_rows(task), -wall_rows(task)  # n . x >= d as -n . x <= -d
    for t, c in np.argwhere(plan.modes == FREE):
        sides = np.concatenate([_region_of(regions[t], plan.positions[t, c]), walls])
        if len(sides) > rows:
            raise InvalidProblem(
                "rows", expected=f"at least {len(sides)} for the free finger {c} at step {t}", got=str(rows)
            )
        normals[t, c, : len(sides)], offsets[t, c, : len(sides)] = sides[:, :2], sides[:, 2]
    return normals, offsets


def _region_of(regions: Array, position: Array) -> Array:
    """Rows (h, 3) of the region, among (R, H, 3), with most room around the position: the one that the expert settles on."""
    room = (regions[..., 2] - regions[..., :2] @ position).min(axis=1)
    region = regions[room.argmax()]
    return region[region[:, :2].any(axis=1)]


def _external(task: ContactTask) -> tuple[Array, Array, Array]:
    """Flags (T, E), points (T, E, 2) and rays (T, E, 2, 2) of the ground contacts, absent ones last."""
    present = np.zeros((task.steps, EXTERNAL_CONTACTS))
    points = np.repeat(task.trajectory.poses[:, None, :2], EXTERNAL_CONTACTS, axis=1)
    rays = np.zeros((task.steps, EXTERNAL_CONTACTS, 2, 2))
    for t in range(task.steps):
        here: list[ExternalContact] = [c for c in external_contacts(task) if c.step == t]
        if len(here) > EXTERNAL_CONTACTS:
            raise InvalidProblem(
                "environment.walls",
                expected=f"at most {EXTERNAL_CONTACTS} contacts with walls at a step",
                got=f"{len(here)} at step {t}",
            )
        for e, contact in enumerate(here):
            present[t, e], points[t, e] = 1.0, contact.point
            rays[t, e] = contact.rays  # the one ray of a sliding contact takes both places
    return present, points, rays
