"""An independent proof of infeasibility: some step at which no placement of the fingers balances the forces."""

import itertools

import numpy as np
from scipy.optimize import linprog

from expert.geometry.pose import Array
from expert.mechanics import external_contacts, friction_rays, required_wrench, wrench_about
from expert.problems.contact import ContactTask

MARGIN = 1e-6
"""Imbalance over m g and m g L that counts as proved: ten times what the linear programs are solved to."""


def first_unbalanced_step(task: ContactTask) -> int | None:
    """First step whose required wrench no combination of facets can exert, or None.

    Every step is relaxed: fingers appear anywhere on their facets, regardless of what they did before.
    Enumerates all assignments of fingers to facets; each is one linear program with slack.
    """
    reach = [_finger_wrenches(task, t) for t in range(task.steps)]
    return next((t for t in range(task.steps) if _unbalanced(task, t, reach[t])), None)


def _unbalanced(task: ContactTask, step: int, reach: list[Array]) -> bool:
    contacts = external_contacts(task)
    target = required_wrench(task, contacts)[step]
    free = [c for c in contacts if c.step == step and not c.fixed]
    centre = task.trajectory.poses[step, :2]
    environment = [(wrench_about(c.rays, c.point, centre), c.limit) for c in free]
    fingers = [(wrenches, task.fingers.max_force) for wrenches in reach]
    choices = itertools.combinations_with_replacement(fingers, task.fingers.count) if fingers else [()]
    scale = task.weight * np.array([1.0, 1.0, task.body.size])
    return all(_imbalance([*environment, *choice], target, scale) > MARGIN for choice in choices)


def _finger_wrenches(task: ContactTask, step: int) -> list[Array]:
    """Extreme wrenches (4, 3) per newton of normal force of one finger on each facet that it can reach.

    The facet's wrench cone is the hull of the cones at the two ends of the stretch that keeps clear of facet ends and walls,
    now and, since a finger that pushes stays where it is, at the next step.
    """
    centre = task.trajectory.poses[step, :2]
    a, b = task.body.facets_w(task.trajectory.poses[step])
    normals, _ = task.body.frames_w(task.trajectory.poses[step])
    rays = friction_rays(normals, task.robustness.cone_fraction * task.fingers.friction)
    wrenches = []
    for facet, (low, high) in enumerate(zip(*_clear_stretch(task, step), strict=True)):
        if low <= high:
            ends = a[facet] + np.array([[low], [high]]) * (b[facet] - a[facet])
            corners = [wrench_about(ray, end, centre) for end in ends for ray in rays[facet]]
            wrenches.append(np.stack(corners))
    return wrenches


def _clear_stretch(task: ContactTask, step: int) -> tuple[Array, Array]:
    """Interval of rho on each facet, (V,) each, that keeps the facet margin and the clearance from walls; empty: low > high."""
    margin = task.fingers.facet_margin
    low, high = np.full(len(task.body.vertices), margin), np.full(len(task.body.vertices), 1 - margin)
    for pose in task.trajectory.poses[step : step + 2]:
        a, b = task.body.facets_w(pose)
        for wall in task.environment.walls:
            start, stop = wall.gap(a) - task.fingers.clearance, wall.gap(b) - task.fingers.clearance
            with np.errstate(divide="ignore", invalid="ignore"):
                crossing = start / (start - stop)
            low = np.where((start < 0) & (stop >= 0), np.maximum(low, crossing), low)
            high = np.where((stop < 0) & (start >= 0), np.minimum(high, crossing), high)
            high = np.where((start < 0) & (stop < 0), -1.0, high)
    return low, high


def _imbalance(parts: list[tuple[Array, float]], target: Array, scale: Array) -> float:
    """Least 1-norm of the scaled wrench that is missing when each part exerts weights >= 0 that sum to at most its limit."""
    wrenches = np.concatenate([w for w, _ in parts] or [np.empty((0, 3))]) / scale
    count = len(wrenches)
    # Weights are in units of the weight m g, so that all numbers of the program are of order one.
    unit = scale[0]
    cost = np.concatenate([np.zeros(count), np.ones(6)])
    balance = np.hstack([unit * wrenches.T, np.eye(3), -np.eye(3)])
    limits = np.zeros((len(parts), count + 6))
    start = 0
    for row, (w, _) in zip(limits, parts, strict=True):
        row[start : start + len(w)] = 1.0
        start += len(w)
    result = linprog(
        cost,
        A_eq=balance,
        b_eq=target / scale,
        A_ub=limits if len(parts) else None,
        b_ub=np.array([limit for _, limit in parts]) / unit if len(parts) else None,
        method="highs",
    )
    return float(result.fun) if result.status == 0 else 0.0  # an unsolved program proves nothing
