"""From contact modes and positions to a Plan: forces by one exact program per step, figures from the plan itself."""

from typing import NamedTuple

import numpy as np
from numba import njit

from expert.contact.leaf import pushes
from expert.contact.model import Model
from expert.contact.qp import SOLVED
from expert.contact.sequence import Sequence, smoothing
from expert.contact.steps import solve_step, step_program
from expert.errors import SolverFailed
from expert.geometry.pose import Array
from expert.mechanics import external_contacts
from expert.types import SUPPORT, ContactForce, ContactTask


class Forces(NamedTuple):
    """At fixed positions: cost of the whole plan (inf: none), forces (T, C, 2) [m g], normal forces (T, K) by contact
    interval, ray weights (T, E) of reactions."""

    cost: float
    fingers: Array
    normal: Array
    reactions: Array


@njit(cache=True)
def forces_at(model: Model, sequence: Sequence, z: Array) -> Forces:
    """Least-cost forces for contact positions z; exact torque, since positions are fixed."""
    T, C = sequence.modes.shape
    fingers, reactions = np.zeros((T, C, 2)), np.zeros(model.group.shape)
    normal = np.zeros((T, sequence.lo.size))
    total = smoothing(sequence, z)
    for t in range(T):
        on = pushes(sequence, t)
        status, cost, _, _, x = solve_step(model, t, sequence.facet[on], z[on], z[on])
        if status != SOLVED:
            return Forces(np.inf, fingers, normal, reactions)
        total += cost
        _, _, _, _, force = step_program(model, t, sequence.facet[on], z[on], z[on])
        k = 0
        each = 3 if model.margin_weight > 0 else 2
        for c in range(C):
            if (on == sequence.interval[t, c]).any():
                for _ in range(each):
                    weight = max(x[k], 0.0)
                    normal[t, sequence.interval[t, c]] += weight
                    fingers[t, c, 0] += weight * force[0, k]
                    fingers[t, c, 1] += weight * force[1, k]
                    k += 1
        for e in range(x.size - k):
            reactions[t, e] = max(x[k + e], 0.0)
    return Forces(total, fingers, normal, reactions)


def positions_at(task: ContactTask, model: Model, sequence: Sequence, z: Array) -> Array:
    """Finger positions (T, C, 2) [m], world frame."""
    return model.origin + task.body.size * (sequence.offset + sequence.map @ z)


def finger_forces(
    task: ContactTask, model: Model, sequence: Sequence, z: Array
) -> tuple[Array, tuple[ContactForce, ...]]:
    """Forces (T, C, 2) [N] on the object, and what the environment exerts.  Raises SolverFailed."""
    forces = forces_at(model, sequence, z)
    if not np.isfinite(forces.cost):
        raise SolverFailed("the forces of a plan could not be computed again at its contact positions")
    used = [0] * task.steps
    reactions = []
    for contact in external_contacts(task):
        if contact.fixed:
            force = contact.rays[0]
        else:
            first = used[contact.step]
            used[contact.step] += len(contact.rays)
            unit = 1.0 if contact.wall == SUPPORT else task.weight
            force = unit * forces.reactions[contact.step, first : used[contact.step]] @ contact.rays
        if force.any():
            reactions.append(
                ContactForce(
                    step=contact.step,
                    vertex=contact.vertex,
                    wall=contact.wall,
                    point=contact.point,
                    force=force,
                )
            )
    return task.weight * forces.fingers, tuple(reactions)
