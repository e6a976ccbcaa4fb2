"""Pushes made exact by damped Gauss-Newton: the last push of many plans, three numbers against three of a pose, or all of one plan."""

import numpy as np

from expert.geometry.pose import Array, rotation
from expert.pushing.goal import Goal
from expert.pushing.table import Table

NUDGES = np.array([1.0, 0.02, 1.0])
"""Differences for the Jacobian: arc length, angle [rad], length."""
REACH = np.array([25.0, 0.5, 40.0])
"""Steps are cut to this."""


def composed(poses: Array, shifts: Array) -> Array:
    """Poses (..., 3) after shifts (..., 3) in the body frame."""
    moved = (rotation(poses[..., 2]) @ shifts[..., :2, None])[..., 0]
    return np.concatenate([poses[..., :2] + moved, (poses[..., 2] + shifts[..., 2])[..., None]], axis=-1)


def refine(
    table: Table, goal: Goal, before: Array, parameters: Array, rounds: int, unit: float = 1.0
) -> tuple[Array, Array, Array, Array]:
    """Pushes (N, 3) from poses `before` (N, 3), improved towards the goal: pushes, poses after, fingers, errors (N,).

    unit: length of which NUDGES and REACH are multiples.  A push never becomes worse, nor shorter than a unit.
    """
    scale = np.array([unit, 1.0, unit])
    nudges, count = NUDGES * scale, len(parameters)
    best = parameters.copy()
    shifts, fingers = table.outcomes(best)
    after = composed(before, shifts)
    residual = goal.residual(after)
    damping, slopes = np.full(count, 1e-3), np.empty((count, 3, 3))
    moved_on = np.ones(count, dtype=bool)  # the others' slopes are known
    for _ in range(rounds):
        probes = (best[moved_on, None] + nudges * np.eye(3)).reshape(-1, 3)
        probed = composed(np.repeat(before[moved_on], 3, axis=0), table.outcomes(probes)[0])
        changes = goal.residual(probed).reshape(-1, 3, 3) - residual[moved_on, None]
        slopes[moved_on] = changes.swapaxes(1, 2)
        step = _damped(slopes, residual, damping) * nudges
        step = np.nan_to_num(step)  # next to pushes without outcome
        trial = best + np.clip(step, -REACH * scale, REACH * scale)
        trial[:, 2] = np.maximum(trial[:, 2], unit)
        shifts, ends = table.outcomes(trial)
        moved = composed(before, shifts)
        found = goal.residual(moved)
        moved_on = (found**2).sum(1) < (residual**2).sum(1)
        best[moved_on], after[moved_on], fingers[moved_on], residual[moved_on] = (
            x[moved_on] for x in (trial, moved, ends, found)
        )
        damping = np.where(moved_on, damping / 5, damping * 20)
    return best, after, fingers, np.sqrt((residual**2).sum(1))


def refine_plan(
    table: Table, goal: Goal, start: Array, chain: Array, rounds: int, unit: float, enough: float
) -> tuple[Array, float]:
    """Pushes (n, 3) from a pose (3,), each changed a little so that the last one ends nearer the goal; its error.

    A push alone may have no say in some direction; a plan has more numbers than a pose.  Ends below the error `enough`.
    """
    scale = np.array([unit, 1.0, unit])
    nudges, count = NUDGES * scale, len(chain)
    best, shifts = chain.copy(), table.outcomes(chain)[0]
    residual, damping = goal.residual(_ended(start, shifts)), np.full(1, 1e-3)
    for _ in range(rounds):
        if np.linalg.norm(residual) <= enough:
            break
        probed = table.outcomes((best[:, None] + nudges * np.eye(3)).reshape(-1, 3))[0]
        tried = np.repeat(shifts[None], 3 * count, axis=0)
        tried[np.arange(3 * count), np.repeat(np.arange(count), 3)] = probed
        slopes = (goal.residual(_ended(start, tried)) - residual).T
        step = _damped(np.nan_to_num(slopes)[None], residual[None], damping)[0].reshape(count, 3) * nudges
        trial = best + np.clip(step, -REACH * scale, REACH * scale)
        trial[:, 2] = np.maximum(trial[:, 2], unit)
        moved = table.outcomes(trial)[0]
        found = goal.residual(_ended(start, moved))
        if found @ found < residual @ residual:
            best, shifts, residual, damping = trial, moved, found, damping / 5
        else:
            damping = damping * 20
    return best, float(np.linalg.norm(residual))


def _ended(start: Array, shifts: Array) -> Array:
    """Pose (..., 3) after shifts (..., n, 3), one after the other."""
    pose = np.broadcast_to(start, (*shifts.shape[:-2], 3))
    for k in range(shifts.shape[-2]):
        pose = composed(pose, shifts[..., k, :])
    return pose


def _damped(slopes: Array, residual: Array, damping: Array) -> Array:
    """Steps (N, P) of least squares for slopes (N, 3, P), with Marquardt's scaling."""
    normal = slopes.swapaxes(1, 2) @ slopes
    diagonal = np.einsum("nii->ni", normal)
    floor = 1e-9 * (diagonal.sum(1, keepdims=True) + 1e-300)
    damped = normal + (damping[:, None] * diagonal + floor)[:, :, None] * np.eye(slopes.shape[2])
    return -np.linalg.solve(damped, slopes.swapaxes(1, 2) @ residual[..., None])[..., 0]
