"""From the variables of a mixed-integer model to a Plan whose cost and residual are computed from the plan itself."""

from dataclasses import dataclass

import numpy as np

from expert.contact.scaled import ScaledTask, ray_size
from expert.geometry.pose import Array
from expert.mechanics import external_contacts, inertial_wrench, wrench_about
from expert.types import FREE, ContactForce, ContactTask, IntArray, Plan, Status


@dataclass(frozen=True)
class Found:
    """A model's point.  modes (t, c); rho (t, c) along the facet; alpha (t, c, k) on it; free (t, c, d) positions of
    free fingers; reactions (i,): dimensionless, indices as in `ScaledTask`."""

    modes: IntArray
    rho: Array
    alpha: Array
    free: Array
    reactions: Array


def plan_of(
    task: ContactTask,
    s: ScaledTask,
    found: Found,
    *,
    status: Status,
    bound: float,
    seconds: float,
    nodes: int,
    reason: str,
) -> Plan:
    """The plan in SI units.  Solver tolerances are cleaned away: cone weights are >= 0, and none acts at a release."""
    positions, forces = _fingers(s, found)
    positions, forces = positions * s.length, forces * s.weight
    contact_forces = _contact_forces(task, s, found.reactions)
    objective = plan_cost(task, found.modes, positions, forces)
    return Plan(
        status=status,
        objective=objective,
        bound=min(bound, objective),
        seconds=seconds,
        nodes=nodes,
        modes=found.modes,
        positions=positions,
        forces=forces,
        contact_forces=contact_forces,
        residual=wrench_residual(task, positions, forces, contact_forces),
        reason=reason,
    )


def modes_of(assignment: Array) -> IntArray:
    """Facet or FREE (t, c) from contact assignment T (t, c, f)."""
    return np.where(assignment.sum(axis=2) > 0.5, assignment.argmax(axis=2), FREE)


def _fingers(s: ScaledTask, found: Found) -> tuple[Array, Array]:
    """Dimensionless positions and forces (t, c, d): on the facet and in its cone by construction."""
    touching = (found.modes != FREE)[..., None]
    facet = np.maximum(found.modes, 0)
    step = np.arange(len(facet))[:, None]
    a, b = np.moveaxis(s.levers[step, facet], 2, 0)
    on_facet = s.centres[:, None] + a + found.rho[..., None] * (b - a)
    pushes = touching.copy()
    pushes[:-1] &= (found.modes[1:] == found.modes[:-1])[..., None]
    weights = np.where(pushes, np.maximum(found.alpha, 0), 0.0)
    return np.where(touching, on_facet, found.free), np.einsum("tck,tckd->tcd", weights, s.rays[step, facet])


def _contact_forces(task: ContactTask, s: ScaledTask, reactions: Array) -> tuple[ContactForce, ...]:
    """What the environment exerts at every contact, sliding support friction included."""
    chosen, first = {}, 0
    for c in s.contacts:
        weights = np.maximum(reactions[first : first + len(c.rays)], 0)
        chosen[c.step, c.wall, c.vertex] = weights @ c.rays * (s.weight / ray_size(c))
        first += len(c.rays)
    forces = []
    for c in external_contacts(task):
        force = c.rays[0] if c.fixed else chosen.get((c.step, c.wall, c.vertex), np.zeros(2))
        if force.any():
            forces.append(ContactForce(step=c.step, vertex=c.vertex, wall=c.wall, point=c.point, force=force))
    return tuple(forces)


def plan_cost(task: ContactTask, modes: IntArray, positions: Array, forces: Array) -> float:
    """The thesis's J = sum |lambda|^2 + |p_ddot|^2 - beta, p_ddot by backward differences from the third step on."""
    acceleration = np.diff(positions, n=2, axis=0) / task.trajectory.dt**2
    cost = task.cost.force * np.sum(forces**2) + task.cost.acceleration * np.sum(acceleration**2)
    if task.cost.margin == 0:
        return float(cost)
    normal, tangent = task.body.frames_w(task.trajectory.poses)
    facet, step = np.maximum(modes, 0), np.arange(task.steps)[:, None]
    lam_n, lam_t = (np.sum(forces * frame[step, facet], axis=2) for frame in (normal, tangent))
    mu = task.fingers.friction
    beta = (mu * lam_n - np.abs(lam_t)) / np.hypot(1, mu)
    return float(cost - task.cost.margin * np.sum(beta[modes != FREE]))


def wrench_residual(
    task: ContactTask, positions: Array, forces: Array, contact_forces: tuple[ContactForce, ...]
) -> float:
    """Largest violation of Newton-Euler over m g and m g L, with the true torque (p - q) x lambda."""
    centres = task.trajectory.poses[:, :2]
    wrench = wrench_about(forces, positions, centres[:, None]).sum(axis=1) - inertial_wrench(task)
    for c in contact_forces:
        wrench[c.step] += wrench_about(c.force, c.point, centres[c.step])
    return float(np.abs(wrench / [task.weight, task.weight, task.weight * task.body.size]).max())
