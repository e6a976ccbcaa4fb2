"""From the variables of a mixed-integer model to a Plan whose cost and residual are computed from the plan itself."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import lsq_linear

from expert.contact.scaled import ScaledTask, ray_size
from expert.geometry.pose import Array, cross
from expert.mechanics import external_contacts, inertial_wrench, wrench_about
from expert.problems.contact import FREE, ContactForce, ContactTask, Plan, Status
from expert.world.values import IntArray


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


REPAIR = 1e-4
"""Largest change of a weight [m g] or of rho by which a solver's tolerance is repaired."""


def balanced(s: ScaledTask, found: Found, margin: float) -> Found:
    """The point with Newton-Euler restored from a solver's tolerance to the last digits: a few Gauss-Newton steps on
    the weights, which stay >= 0, and on one rho per contact interval, which stays within its margins."""
    interval = intervals(found.modes)
    touching = interval != FREE
    rho = np.where(touching, np.clip(found.rho, margin, 1 - margin), 0.0)
    rho = np.bincount(interval[touching], rho[touching]) / np.bincount(interval[touching])
    weights = np.concatenate([found.alpha.ravel(), found.reactions])
    allowed = np.append(np.repeat(pushing(found.modes), 2), np.full(len(found.reactions), True))
    weights = np.where(allowed, np.maximum(weights, 0), 0)
    for _ in range(3):
        found = _put(found, weights, rho, interval)
        columns = _wrench_columns(s, found) * allowed
        jacobian = np.concatenate([columns, _torque_slopes(s, found, interval, len(rho))], axis=1)
        low = np.append(np.maximum(-weights, -REPAIR), np.maximum(margin - rho, -REPAIR)) - 1e-15
        high = np.append(np.full(len(weights), REPAIR), np.minimum(1 - margin - rho, REPAIR)) + 1e-15
        change = lsq_linear(jacobian, s.required.ravel() - columns @ weights, (low, high), "bvls", 1e-16).x
        weights, rho = np.maximum(weights + change[: len(weights)], 0), rho + change[len(weights) :]
    return _put(found, weights, rho, interval)


def _put(found: Found, weights: Array, rho: Array, interval: IntArray) -> Found:
    alpha, reactions = np.split(weights, [found.alpha.size])
    by_step = np.append(rho, 0.0)[interval]  # FREE selects the last
    return replace(found, rho=by_step, alpha=alpha.reshape(found.alpha.shape), reactions=reactions)


def _wrench_columns(s: ScaledTask, found: Found) -> Array:
    """Wrenches of unit weights, (3 t, weights), at the found contact positions."""
    T, C = found.modes.shape
    positions, _ = _fingers(s, found)
    rays = s.rays[np.arange(T)[:, None], np.maximum(found.modes, 0)]
    unit = wrench_about(rays, positions[:, :, None], s.centres[:, None, None])  # (t, c, k, 3)
    own = np.zeros((T, 3, T, C, 2))
    own[np.arange(T), :, np.arange(T)] = np.moveaxis(unit, 3, 1)
    return np.concatenate([own.reshape(3 * T, -1), s.reactions.reshape(3 * T, -1)], axis=1)


def _torque_slopes(s: ScaledTask, found: Found, interval: IntArray, count: int) -> Array:
    """d torque / d rho (3 t, count): (b - a) x lambda at each step of an interval."""
    T, C = found.modes.shape
    _, forces = _fingers(s, found)
    a, b = np.moveaxis(s.levers[np.arange(T)[:, None], np.maximum(found.modes, 0)], 2, 0)
    slopes = np.zeros((T, 3, count + 1))  # the last column collects what is free
    for c in range(C):
        slopes[np.arange(T), 2, interval[:, c]] += cross(b - a, forces)[:, c]
    return slopes[..., :-1].reshape(3 * T, -1)


def intervals(modes: IntArray) -> IntArray:
    """Number of the contact interval (t, c), counted over all fingers; FREE where there is none."""
    starts = modes != FREE
    starts[1:] &= modes[1:] != modes[:-1]
    return np.where(modes == FREE, FREE, np.cumsum(starts.T).reshape(starts.T.shape).T - 1)


def pushing(modes: IntArray) -> np.ndarray:
    """Where force is allowed (t, c): in contact and, but for the last step, still there at the next."""
    stays = modes != FREE
    stays[:-1] &= modes[1:] == modes[:-1]
    return stays


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
    weights = np.where(pushing(found.modes)[..., None], np.maximum(found.alpha, 0), 0.0)
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
