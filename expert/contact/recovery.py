"""From the variables of a mixed-integer model to a Plan whose cost and residual are computed from the plan itself."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import lsq_linear

from expert.contact.plans import contact_forces, plan_cost, wrench_residual
from expert.contact.scaled import ScaledTask, finger_rays
from expert.geometry.pose import Array, cross
from expert.mechanics import wrench_about
from expert.problems.contact import FREE, ContactTask, Plan, Status
from expert.world.values import IntArray


@dataclass(frozen=True)
class Found:
    """A model's point.  modes (t, c); rho (t, c) along the facet; alpha (t, c, k) on it; free (t, c, d) positions of
    free fingers; reactions (t, e): weights of the environment's rays.  Dimensionless, indices as in `ScaledTask`."""

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
    positions, forces = s.origin + positions * s.size, forces * s.weight
    reactions = contact_forces(task, found.reactions)
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
        contact_forces=reactions,
        residual=wrench_residual(task, positions, forces, reactions),
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
    weights = np.concatenate([found.alpha.ravel(), found.reactions.ravel()])
    allowed = np.append(np.repeat(pushing(found.modes), 2), s.group.ravel() >= 0)
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
    return replace(
        found,
        rho=by_step,
        alpha=alpha.reshape(found.alpha.shape),
        reactions=reactions.reshape(found.reactions.shape),
    )


def _wrench_columns(s: ScaledTask, found: Found) -> Array:
    """Wrenches of unit weights, (3 t, weights), at the found contact positions."""
    T, C = found.modes.shape
    positions, _ = _fingers(s, found)
    rays = finger_rays(s)[np.arange(T)[:, None], np.maximum(found.modes, 0)]
    unit = wrench_about(rays, positions[:, :, None], s.centre[:, None, None])  # (t, c, k, 3)
    own, environment = np.zeros((T, 3, T, C, 2)), np.zeros((T, 3, T, s.rays.shape[1]))
    own[np.arange(T), :, np.arange(T)] = np.moveaxis(unit, 3, 1)
    environment[np.arange(T), :, np.arange(T)] = np.swapaxes(s.rays, 1, 2)
    return np.concatenate([own.reshape(3 * T, -1), environment.reshape(3 * T, -1)], axis=1)


def _torque_slopes(s: ScaledTask, found: Found, interval: IntArray, count: int) -> Array:
    """d torque / d rho (3 t, count): (b - a) x lambda at each step of an interval."""
    T, C = found.modes.shape
    _, forces = _fingers(s, found)
    edge = s.edge[np.arange(T)[:, None], np.maximum(found.modes, 0)]
    slopes = np.zeros((T, 3, count + 1))  # the last column collects what is free
    for c in range(C):
        slopes[np.arange(T), 2, interval[:, c]] += cross(edge, forces)[:, c]
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
    on_facet = s.centre[:, None] + s.arm[step, facet] + found.rho[..., None] * s.edge[step, facet]
    weights = np.where(pushing(found.modes)[..., None], np.maximum(found.alpha, 0), 0.0)
    return np.where(touching, on_facet, found.free), np.einsum(
        "tck,tckd->tcd", weights, finger_rays(s)[step, facet]
    )
