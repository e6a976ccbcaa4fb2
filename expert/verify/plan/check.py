"""Checks a contact trajectory against the laws of mechanics, from poses, positions and forces alone.

Nothing here knows how the plan was found: contact modes of the environment are read from the motion of material points,
cones and costs are written out again.  Lengths are measured over the object's size L, forces over its weight m g.
"""

import itertools
from dataclasses import dataclass, replace

import numpy as np

from expert.budget import Budget
from expert.errors import InvalidProblem
from expert.geometry.polygon import signed_distance
from expert.geometry.pose import Array, cross, to_body
from expert.problems.contact import FREE, ContactTask, Plan
from expert.verify.plan.claims import EFFORT, check_bound, check_infeasible, with_claims
from expert.verify.plan.environment import environment_checks
from expert.verify.plan.report import Check, PlanReport

FINGER = ("step", "finger")


@dataclass(frozen=True, kw_only=True)
class Tolerances:
    """What a plan may miss: wrench over m g and m g L, force over m g, length over L, objective relative."""

    wrench: float = 1e-8
    force: float = 1e-6
    length: float = 1e-6
    objective: float = 1e-6


def verify(task: ContactTask, answer: Plan | None) -> PlanReport:
    """Judge any answer: plans by `check_plan`, bounds and proofs that there is no plan by what they are proved with."""
    if answer is None:
        raise InvalidProblem(
            "file", expected="a solution file", got="a problem file", remedy="solve it first"
        )
    budget = Budget(np.inf)
    if answer.found:
        report = with_claims(task, answer, check_plan(task, answer))
    elif answer.status == "infeasible":
        report = check_infeasible(task, answer)
    else:
        report = check_bound(task, answer)
    return replace(report, claimed=(*report.claimed, *EFFORT), seconds=budget.spent)


def check_plan(task: ContactTask, plan: Plan, tolerances: Tolerances | None = None) -> PlanReport:
    """Judge a plan: sound, or refuted with every law that it breaks (Thesis 3-CT1 to 3-CT7 with exact torques)."""
    limits = tolerances or Tolerances()
    claim = f"{plan.status}, objective {plan.objective:.6g}, bound {plan.bound:.6g}"
    if shape := _wrong_shape(task, plan):
        return PlanReport(verdict="refuted", claim=claim, checks=(shape,))
    checks = (
        *_dynamics(task, plan, limits),
        *_finger_forces(task, plan, limits),
        *_finger_places(task, plan, limits),
        *_contact_sequence(task, plan, limits),
        *environment_checks(task, plan, limits.force, limits.length),
        *_cost(task, plan, limits),
    )
    verdict = "sound" if all(check.ok for check in checks) else "refuted"
    return PlanReport(verdict=verdict, claim=claim, checks=checks)  # type: ignore[arg-type]


def _wrong_shape(task: ContactTask, plan: Plan) -> Check | None:
    """Arrays of the wrong shape or facets that do not exist: no other check makes sense."""
    shape = (task.steps, task.fingers.count)
    fits = plan.modes.shape == shape and plan.positions.shape == plan.forces.shape == (*shape, 2)
    if fits and plan.modes.min() >= FREE and plan.modes.max() < len(task.body.vertices):
        return None
    return Check(name="shape", value=np.inf, limit=0.0, unit="-", where="modes, positions or forces")


def _dynamics(task: ContactTask, plan: Plan, limits: Tolerances) -> tuple[Check, ...]:
    """m a = sum f and I alpha = sum r x f, with weight among the forces (3-CT1, 3-CT2)."""
    q = task.trajectory.poses
    a = task.trajectory.accelerations
    weight = task.weight if task.environment.plane == "sagittal" else 0.0
    force = task.body.mass * a[:, :2] + [0.0, weight] - plan.forces.sum(axis=1)
    torque = task.body.inertia * a[:, 2] - cross(plan.positions - q[:, None, :2], plan.forces).sum(axis=1)
    for c in plan.contact_forces:
        force[c.step] -= c.force
        torque[c.step] -= cross(c.point - q[c.step, :2], c.force)
    residual = np.column_stack([np.abs(force) / task.weight, np.abs(torque) / (task.weight * task.body.size)])
    misstated = np.nan_to_num(abs(plan.residual - residual.max()))  # nan: nothing is stated
    return (
        Check.largest("newton_euler", residual, limits.wrench, "m g, m g L", ("step", "component")),
        Check.largest("residual", misstated, limits.wrench, "m g, m g L", ()),
    )


def _finger_forces(task: ContactTask, plan: Plan, limits: Tolerances) -> tuple[Check, ...]:
    """Forces of touching fingers in their cones and limits, of free fingers none (3-CT3, 3-CT4)."""
    normal, tangential = _facet_components(task, plan)
    touching = plan.modes != FREE
    mu = task.robustness.cone_fraction * task.fingers.friction
    outside = np.where(touching, np.maximum(np.abs(tangential) - mu * normal, -normal), 0.0)
    free_force = np.where(touching, 0.0, np.linalg.norm(plan.forces, axis=2))
    too_little = np.where(_may_push(plan), task.robustness.min_normal_force - normal, 0.0)
    excess = np.where(touching, normal - task.fingers.max_force, 0.0)
    named = {
        "finger_cone": outside,
        "complementarity": free_force,
        "force_limit": excess,
        "min_normal_force": too_little,
    }
    return tuple(
        Check.largest(name, v / task.weight, limits.force, "m g", FINGER) for name, v in named.items()
    )


def _facet_components(task: ContactTask, plan: Plan) -> tuple[Array, Array]:
    """Finger forces along the inward normal and the tangent of the claimed facet, each (T, C) [N]."""
    frames = task.body.frames_w(task.trajectory.poses)
    facet = np.maximum(plan.modes, 0)[..., None]
    normal, tangent = (np.take_along_axis(frame, facet, axis=1) for frame in frames)
    return (plan.forces * normal).sum(-1), (plan.forces * tangent).sum(-1)


def _may_push(plan: Plan) -> np.ndarray:
    """Steps (T, C) at which force is allowed: in contact now and, unless it is the last step, on the same facet next."""
    stays = np.ones(plan.modes.shape, dtype=bool)
    stays[:-1] = plan.modes[1:] == plan.modes[:-1]
    return stays & (plan.modes != FREE)


def _finger_places(task: ContactTask, plan: Plan, limits: Tolerances) -> tuple[Check, ...]:
    """Touching fingers on their facets, free ones clear of the object, all of them clear of walls (3-CT3, 3-CT7)."""
    touching = plan.modes != FREE
    distance = np.stack([signed_distance(task.body.vertices, p) for p in _body_frame(task, plan.positions)])
    wall_gap = np.stack(
        [np.full(touching.shape, np.inf), *(w.gap(plan.positions) for w in task.environment.walls)]
    )
    named = {
        "on_facet": np.where(touching, _distance_to_facet(task, plan), 0.0),
        "penetration": -distance,
        "clearance": np.where(touching, 0.0, task.robustness.free_clearance - distance),
        "wall_clearance": task.fingers.clearance - wall_gap.min(axis=0),
    }
    return tuple(
        Check.largest(name, v / task.body.size, limits.length, "L", FINGER) for name, v in named.items()
    )


def _body_frame(task: ContactTask, points: Array) -> Array:
    """World points (T, C, 2) at the poses of their steps, in the body frame."""
    return to_body(task.trajectory.poses, points)


def _distance_to_facet(task: ContactTask, plan: Plan) -> Array:
    """Distance (T, C) [m] of the fingers from their claimed facets without the margins at both ends."""
    a, b = task.body.facets_w(task.trajectory.poses)
    facet = np.maximum(plan.modes, 0)[..., None]
    a, b = (np.take_along_axis(ends, facet, axis=1) for ends in (a, b))
    edge = b - a
    rho = ((plan.positions - a) * edge).sum(-1) / (edge * edge).sum(-1)
    margin = task.fingers.facet_margin
    nearest = a + np.clip(rho, margin, 1 - margin)[..., None] * edge
    return np.linalg.norm(plan.positions - nearest, axis=-1)


def _contact_sequence(task: ContactTask, plan: Plan, limits: Tolerances) -> tuple[Check, ...]:
    """Sticking, release before another facet is taken, no force at the release, contacts that last (3-CT5)."""
    now, later = plan.modes[:-1], plan.modes[1:]
    body = _body_frame(task, plan.positions)
    moved = np.linalg.norm(body[1:] - body[:-1], axis=2) / task.body.size
    held = (now == later) & (now != FREE)
    jumps = (now != later) & (now != FREE) & (later != FREE)
    at_release = np.where(_may_push(plan), 0.0, np.linalg.norm(plan.forces, axis=2)) / task.weight
    short = [
        [float(task.robustness.min_interval - stop + start) for start, stop in _intervals(plan.modes[:, c])]
        for c in range(task.fingers.count)
    ]
    return (
        Check.largest("sticking", np.where(held, moved, 0.0), limits.length, "L", FINGER),
        Check.largest("alternation", jumps, 0.0, "facet changes in contact", FINGER),
        Check.largest("release", at_release, limits.force, "m g", FINGER),
        Check.largest("min_interval", [max([0.0, *s]) for s in short], 0.0, "missing steps", ("finger",)),
    )


def _intervals(modes: np.ndarray) -> list[tuple[int, int]]:
    """Contact intervals [start, stop) of one finger."""
    changes = [0, *(np.flatnonzero(np.diff(modes)) + 1).tolist(), len(modes)]
    return [(i, j) for i, j in itertools.pairwise(changes) if modes[i] != FREE]


def _cost(task: ContactTask, plan: Plan, limits: Tolerances) -> tuple[Check, ...]:
    """The stated objective is the plan's cost, and the stated bound does not exceed it."""
    true = plan_cost(task, plan)
    scale = max(abs(true), 1e-12)
    excess = (plan.bound - plan.objective) / scale
    unproved = np.inf if plan.status == "optimal" and not np.isfinite(plan.bound) else 0.0
    return (
        Check.largest("objective", abs(plan.objective - true) / scale, limits.objective, "objective", ()),
        Check.largest("bound", max(excess, unproved), limits.objective, "objective", ()),
    )


def plan_cost(task: ContactTask, plan: Plan) -> float:
    """sum |lambda|^2 + |p_ddot|^2 - beta (Thesis 3.1.4), p_ddot by backward differences from the third step on."""
    p = plan.positions
    acceleration = (p[2:] - 2 * p[1:-1] + p[:-2]) / task.trajectory.dt**2
    cost = task.cost.force * (plan.forces**2).sum() + task.cost.acceleration * (acceleration**2).sum()
    return float(cost - task.cost.margin * _distance_to_cone_edge(task, plan).sum())


def _distance_to_cone_edge(task: ContactTask, plan: Plan) -> Array:
    """Distance [N] of each finger force inside its full cone from the nearer edge, (T, C); none for free fingers."""
    normal, tangential = _facet_components(task, plan)
    mu = task.fingers.friction
    distance = (mu * normal - np.abs(tangential)) / np.hypot(1.0, mu)
    return np.where(plan.modes == FREE, 0.0, distance)
