"""From contact modes and positions to forces and a plan's arrays: one exact program per step at fixed positions."""

from typing import NamedTuple

import numpy as np

from expert.contact.leaf import pushes
from expert.contact.model import Model
from expert.contact.sequence import Sequence, smoothing
from expert.contact.steps import rays_per_end, solve_step
from expert.errors import SolverFailed
from expert.geometry.pose import Array
from expert.mechanics import external_contacts
from expert.numeric.qp import SOLVED, compiled
from expert.problems.contact import SUPPORT, ContactForce, ContactTask


class Forces(NamedTuple):
    """Least-cost forces at fixed positions: cost of the whole plan (inf: none) and ray weights (T, N) [m g].

    Rays of a step: those of each pushing finger in turn (cone edges n + mu tau, n - mu tau, and n if a margin is
    rewarded), then the environment's.
    """

    cost: float
    weights: Array


@compiled
def forces_at(model: Model, sequence: Sequence, z: Array) -> Forces:
    """Exact torque: with positions fixed, the wrench balance is linear."""
    T, C = sequence.modes.shape
    weights = np.zeros((T, 3 * C + model.rays.shape[1]))
    total = smoothing(sequence, z)
    for t in range(T):
        on = pushes(sequence, t)
        status, cost, _, _, x = solve_step(model, t, sequence.facet[on], z[on], z[on])
        if status != SOLVED:
            return Forces(np.inf, weights)
        total += cost
        weights[t, : x.size] = np.maximum(x, 0.0)
    return Forces(total, weights)


def positions_at(task: ContactTask, model: Model, sequence: Sequence, z: Array) -> Array:
    """Finger positions (T, C, 2) [m], world frame."""
    return model.origin + task.body.size * (sequence.offset + sequence.map @ z)


def all_forces(
    task: ContactTask, model: Model, sequence: Sequence, z: Array
) -> tuple[Array, tuple[ContactForce, ...]]:
    """Finger forces (T, C, 2) [N, on the object] and what the environment exerts.  Raises SolverFailed."""
    found = forces_at(model, sequence, z)
    if not np.isfinite(found.cost):
        raise SolverFailed("the forces of a plan could not be computed again at its contact positions")
    fingers, reactions = np.zeros((*sequence.modes.shape, 2)), []
    each = rays_per_end(model)
    slopes = model.friction * np.array([1.0, -1.0, 0.0][:each])
    for t, weights in enumerate(task.weight * found.weights):
        on = pushes(sequence, t)
        for i, k in enumerate(on):
            f, share = sequence.facet[k], weights[each * i : each * (i + 1)]
            c = int(np.flatnonzero(sequence.interval[t] == k)[0])
            fingers[t, c] = share.sum() * model.normal[t, f] + (share @ slopes) * model.tangent[t, f]
        reactions += _environment(task, t, weights[each * len(on) :])
    return fingers, tuple(reactions)


def _environment(task: ContactTask, t: int, weights: Array) -> list[ContactForce]:
    """Contact forces at step t from the weights [N] of the free rays, and those that sliding on the support fixes."""
    reactions, used = [], 0
    for contact in external_contacts(task):
        if contact.step != t:
            continue
        force = contact.rays[0]
        if not contact.fixed:
            share = weights[used : used + len(contact.rays)]
            used += len(contact.rays)
            force = share @ contact.rays / (task.weight if contact.wall == SUPPORT else 1.0)
        if force.any():
            reactions.append(
                ContactForce(
                    step=t, vertex=contact.vertex, wall=contact.wall, point=contact.point, force=force
                )
            )
    return reactions
