"""Mechanical parameters P(t) of a task (Thesis 4-CT4): all that the inverse dynamics must know to find the expert's plan."""

import itertools
from dataclasses import dataclass, fields

import numpy as np

from expert.errors import InvalidProblem
from expert.geometry.convex import Region, free_regions
from expert.geometry.pose import Array, rotation
from expert.mechanics import ExternalContact, external_contacts, friction_rays, inertial_wrench
from expert.types import FREE, ContactTask, IntArray, Plan, require

EXTERNAL_CONTACTS = 2
REGION_ROWS = 4
NO_ROW = 1.0
"""Offset [m] of an empty region row, 0 . p <= 1: never active."""


@dataclass(frozen=True, kw_only=True)
class MechanicalParameters:
    """P(t) of one task, SI, world frame; t step, c finger, e external contact, h region row, j end point, k ray, d coordinate.

    poses (t, 3)             r, of the centre of mass.
    wrench (t, 3)            M r_ddot + G, what all contacts together must exert about the centre of mass [N, N, N m].
    facets (t, c, j, d)      segment open to a touching finger: the facet less margin and wall clearance; the same fractions
                             over one contact interval.  A free finger keeps its nearest interval's facet (moving with the object).
    cones (t, c, k, d)       rays of unit normal component, tightened as the expert's.
    contact (t, c)           1 where the finger touches its facet.
    stick (t, c)             1 where it keeps its place to the next step (to the end, at the last): only then may it push.
    force_limits (t, c, 2)   least and largest normal force of a pushing finger [N].
    region_normals (t, c, h, d), region_offsets (t, c, h)   free fingers: A p <= b; empty rows are 0 . p <= 1.
    external_contact (t, e), external_points (t, e, d), external_cones (t, e, k, d)   ground contacts: 1 where there is one, where,
                             and its cone; both rays of a sliding contact are the same, fillers are zero rays at the centre of mass.
    reference_positions, reference_forces (t, c, d)         where the torque is linearised: the expert's plan.
    """

    poses: Array
    wrench: Array
    facets: Array
    cones: Array
    contact: Array
    stick: Array
    force_limits: Array
    region_normals: Array
    region_offsets: Array
    external_contact: Array
    external_points: Array
    external_cones: Array
    reference_positions: Array
    reference_forces: Array

    def __post_init__(self) -> None:
        steps, fingers = np.shape(self.contact)
        rows, external = np.shape(self.region_offsets)[-1], np.shape(self.external_points)[-2]
        for name, shape in field_shapes(fingers, rows, external).items():
            value = np.array(getattr(self, name), dtype=float)
            require(value.shape == (steps, *shape), name, f"shape {(steps, *shape)}", value.shape)
            require(bool(np.isfinite(value).all()), name, "finite numbers", "nan or inf")
            value.setflags(write=False)
            object.__setattr__(self, name, value)

    def arrays(self) -> dict[str, Array]:
        """All fields by name."""
        return {f.name: getattr(self, f.name) for f in fields(self)}


def field_shapes(
    fingers: int, rows: int = REGION_ROWS, external: int = EXTERNAL_CONTACTS
) -> dict[str, tuple[int, ...]]:
    """Shape of each field at one step, in the one order that everybody uses."""
    return {
        "poses": (3,),
        "wrench": (3,),
        "facets": (fingers, 2, 2),
        "cones": (fingers, 2, 2),
        "contact": (fingers,),
        "stick": (fingers,),
        "force_limits": (fingers, 2),
        "region_normals": (fingers, rows, 2),
        "region_offsets": (fingers, rows),
        "external_contact": (external,),
        "external_points": (external, 2),
        "external_cones": (external, 2, 2),
        "reference_positions": (fingers, 2),
        "reference_forces": (fingers, 2),
    }


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
        facets=_open_segments(task, facet, plan),
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


def _open_segments(task: ContactTask, facet: IntArray, plan: Plan) -> Array:
    """Facets (T, C, 2, 2) less the margin and the part too near to a wall, the latter over whole contact intervals."""
    a, b = task.body.facets_w(task.trajectory.poses)  # (T, V, 2)
    steps = np.arange(task.steps)
    segments = np.empty((*facet.shape, 2, 2))
    for c, mode in enumerate(plan.modes.T):
        start, stop = a[steps, facet[:, c]], b[steps, facet[:, c]]
        for run in intervals(mode):
            margin = task.fingers.facet_margin
            low, high = margin, 1 - margin
            if mode[run.start] != FREE:
                low, high = _clear_of_walls(task, start[run], stop[run], low, high)
            segments[run, c, 0] = start[run] + low * (stop - start)[run]
            segments[run, c, 1] = start[run] + high * (stop - start)[run]
    return segments


def _clear_of_walls(task: ContactTask, a: Array, b: Array, low: float, high: float) -> tuple[float, float]:
    """Largest part of [low, high] where a + rho (b - a) keeps the clearance from every wall at every step."""
    for wall in task.environment.walls:
        for gap_a, gap_b in zip(wall.gap(a), wall.gap(b), strict=True):
            room, slope = task.fingers.clearance - gap_a, gap_b - gap_a  # rho slope >= room
            if slope > 0:
                low = max(low, room / slope)
            elif slope < 0:
                high = min(high, room / slope)
    return low, max(low, high)


def _finger_cones(task: ContactTask, facet: IntArray) -> Array:
    normal, _ = task.body.frames_w(task.trajectory.poses)  # (T, V, 2)
    chosen = np.take_along_axis(normal, facet[..., None], axis=1)
    return friction_rays(chosen, task.robustness.cone_fraction * task.fingers.friction)


def _free_rows(task: ContactTask, plan: Plan, rows: int) -> tuple[Array, Array]:
    """Half-planes (T, C, rows, 2), (T, C, rows) of each free finger: the object's free region it is in, and the walls."""
    normals = np.zeros((*plan.modes.shape, rows, 2))
    offsets = np.full((*plan.modes.shape, rows), NO_ROW)
    regions = free_regions(task.body.vertices, task.robustness.free_clearance)
    for t, c in np.argwhere(plan.modes == FREE):
        region = _region_of(task, regions, int(t), plan.positions[t, c])
        walls = [(-w.normal, -(w.normal @ w.point) - task.fingers.clearance) for w in task.environment.walls]
        A = np.vstack([region.A, *(n for n, _ in walls)])
        b = np.concatenate([region.b, [o for _, o in walls]])
        if len(b) > rows:
            raise InvalidProblem(
                "rows", expected=f"at least {len(b)} for a free finger at step {t}", got=str(rows)
            )
        normals[t, c, : len(b)], offsets[t, c, : len(b)] = A, b
    return normals, offsets


def _region_of(task: ContactTask, regions: list[Region], t: int, position: Array) -> Region:
    """The free region that holds the position most deeply, drawn in by the clearance, in the world frame at step t."""
    pose = task.trajectory.poses[t]
    turn = rotation(pose[2])
    in_world = [Region(r.A @ turn.T, r.b + r.A @ turn.T @ pose[:2]) for r in regions]
    return max(in_world, key=lambda r: float((r.b - r.A @ position).min()))


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
            present[t, e], points[t, e], rays[t, e] = (
                1.0,
                contact.point,
                contact.rays,
            )  # one ray fills both places
    return present, points, rays
