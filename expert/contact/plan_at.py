"""From contact modes and positions to forces and a plan's arrays: one exact program per step at fixed positions."""

from typing import Any, NamedTuple

import numpy as np

from expert.contact.plans import contact_forces, plan_cost, wrench_residual
from expert.contact.scaled import ScaledTask
from expert.contact.sequence import Sequence, fixed, pushes, smoothing
from expert.contact.steps import rays_per_end, solve_step
from expert.errors import SolverFailed
from expert.geometry.pose import Array
from expert.numeric.qp import SOLVED, compiled
from expert.problems.contact import ContactForce, ContactTask, Plan

RESIDUAL = 1e-8
"""Largest Newton-Euler residual of a plan that is handed out, over m g and m g L."""


class Forces(NamedTuple):
    """Least-cost forces at fixed positions: cost of the whole plan (inf: none) and ray weights (T, N) [m g].

    Rays of a step: those of each pushing finger in turn (cone edges n + mu tau, n - mu tau, and n if a margin is
    rewarded), then the environment's.
    """

    cost: float
    weights: Array


@compiled
def forces_at(scaled: ScaledTask, sequence: Sequence, z: Array) -> Forces:
    """Exact torque: with positions fixed, the wrench balance is linear."""
    T, C = sequence.modes.shape
    weights = np.zeros((T, 3 * C + scaled.rays.shape[1]))
    total = smoothing(sequence, z)
    for t in range(T):
        found = solve_step(scaled, fixed(sequence, t, z))
        if found.status != SOLVED:
            return Forces(np.inf, weights)
        total += found.cost
        weights[t, : found.x.size] = np.maximum(found.x, 0.0)
    return Forces(total, weights)


def plan_at(task: ContactTask, scaled: ScaledTask, sequence: Sequence, z: Array, **known: Any) -> Plan:
    """The plan at z, its forces computed again with exact torques; `known`: what else there is to say.

    Raises SolverFailed where its forces miss Newton-Euler by more than RESIDUAL.
    """
    positions = scaled.origin + scaled.size * (sequence.offset + sequence.map @ z)
    forces, reactions = _forces(task, scaled, sequence, z)
    residual = wrench_residual(task, positions, forces, reactions)
    if not residual <= RESIDUAL:
        raise SolverFailed(f"the best plan misses Newton-Euler by {residual:.2g} of the object's weight")
    return Plan(
        objective=plan_cost(task, sequence.modes, positions, forces),
        modes=sequence.modes,
        positions=positions,
        forces=forces,
        contact_forces=reactions,
        residual=residual,
        **known,
    )


def _forces(
    task: ContactTask, scaled: ScaledTask, sequence: Sequence, z: Array
) -> tuple[Array, tuple[ContactForce, ...]]:
    """Finger forces (T, C, 2) [N, on the object] and what the environment exerts."""
    found = forces_at(scaled, sequence, z)
    if not np.isfinite(found.cost):
        raise SolverFailed("the forces of a plan could not be computed again at its contact positions")
    fingers, reactions = np.zeros((*sequence.modes.shape, 2)), np.zeros(scaled.group.shape)
    each = rays_per_end(scaled)
    slopes = scaled.friction * np.array([1.0, -1.0, 0.0][:each])
    for t, weights in enumerate(found.weights):
        on = pushes(sequence, t)
        for i, k in enumerate(on):
            f, share = sequence.facet[k], weights[each * i : each * (i + 1)]
            c = int(np.flatnonzero(sequence.interval[t] == k)[0])
            fingers[t, c] = share.sum() * scaled.normal[t, f] + (share @ slopes) * scaled.tangent[t, f]
        present = scaled.group[t] >= 0
        reactions[t, present] = weights[each * len(on) :][: present.sum()]
    return task.weight * fingers, contact_forces(task, reactions)
