"""Drive a plan to a stationary point at fixed modes, so that a differentiable layer has the same optimum.

Successive convex programs with the torque to first order, (p0 - q) x lambda + (p - p0) x lambda0; forces are recomputed
exactly at the new positions and steps are halved until the true cost falls.  Any Karush-Kuhn-Tucker point of the task at
fixed modes is a fixed point, and the minimiser of its own convex program.
"""

import numpy as np
from numba import njit

from expert.contact.leaf import pushes
from expert.contact.model import Model
from expert.contact.plan_at import forces_at
from expert.contact.qp import SOLVED, solve_qp
from expert.contact.sequence import Sequence, nearest_region, standing_rows
from expert.contact.steps import step_program
from expert.geometry.pose import Array
from expert.types import IntArray

STATIONARY = 1e-9
"""A plan is stationary when its own convex program moves no variable by more (rho, and lengths in L)."""
PROXIMAL = 1e-6
"""Curvature, relative to the smoothing weight, towards the current point: settles flat directions, moves no fixed point."""


@njit(cache=True)
def settle_regions(model: Model, sequence: Sequence, z: Array) -> IntArray:
    """Region with most room around each free finger, (T, C); -1 elsewhere."""
    assigned = np.full(sequence.modes.shape, -1)
    for t in range(assigned.shape[0]):
        for c in range(assigned.shape[1]):
            v = sequence.free[t, c]
            if v >= 0:
                assigned[t, c], _ = nearest_region(model, t, z[v], z[v + 1])
    return assigned


@njit(cache=True)
def first_order_step(
    model: Model, sequence: Sequence, z: Array, assigned: IntArray, proximal: float
) -> tuple[bool, Array]:
    """Minimiser z of the convex program with the torque expanded to first order at z and its exact forces."""
    T, n = len(sequence.modes), z.size
    standing, side = standing_rows(model, sequence, sequence.lo, sequence.hi, assigned, n)
    normal = forces_at(model, sequence, z).normal
    width, rows = n, side.size
    for t in range(T):
        on = pushes(sequence, t)
        _, g, _, b, _ = step_program(model, t, sequence.facet[on], z[on], z[on])
        width += g.size
        rows += b.size if g.size > 0 else 0
    H, g, A, b = np.zeros((width, width)), np.zeros(width), np.zeros((rows, width)), np.zeros(rows)
    H[:n, :n] = sequence.Q
    g[:n] = sequence.q
    weight = proximal * (1 + model.acceleration_weight)
    for i in range(n):
        H[i, i] += weight
        g[i] -= weight * z[i]
    balances = 0  # equalities come first
    for t in range(T):
        balances += 3 if _size(model, sequence, t) > 0 else 0
    A[balances : balances + side.size, :n] = standing
    b[balances : balances + side.size] = side
    column, row, top = n, balances + side.size, 0
    for t in range(T):
        on = pushes(sequence, t)
        h, c, a, s, _ = step_program(model, t, sequence.facet[on], z[on], z[on])
        if c.size == 0:
            continue
        H[column : column + c.size, column : column + c.size] = h
        g[column : column + c.size] = c
        A[top : top + 3, column : column + c.size] = a[:3]
        b[top : top + 3] = s[:3]
        for k in on:
            torque = model.length[sequence.facet[k]] * normal[t, k]
            A[top + 2, k] += torque
            b[top + 2] += torque * z[k]
        A[row : row + s.size - 3, column : column + c.size] = a[3:]
        b[row : row + s.size - 3] = s[3:]
        column, row, top = column + c.size, row + s.size - 3, top + 3
    status, x, _ = solve_qp(H, g, A[:row], b[:row], balances, 4 * model.iterations)
    return status == SOLVED, x[:n]


@njit(cache=True)
def _size(model: Model, sequence: Sequence, t: int) -> int:
    on = pushes(sequence, t)
    empty = np.zeros(on.size)
    _, g, _, _, _ = step_program(model, t, sequence.facet[on], empty, empty)
    return g.size


@njit(cache=True)
def polish(model: Model, sequence: Sequence, z: Array, rounds: int) -> tuple[Array, float, int]:
    """Stationary point reached from z, the last step's length, and the number of convex programs."""
    z = z.copy()
    cost = forces_at(model, sequence, z).cost
    moved, proximal = np.inf, PROXIMAL
    for count in range(rounds):
        assigned = settle_regions(model, sequence, z)
        solved, target = first_order_step(model, sequence, z, assigned, proximal)
        if not solved:
            return z, moved, count
        moved = np.abs(target - z).max() if z.size > 0 else 0.0
        if moved <= STATIONARY:
            return z, moved, count
        step = 1.0
        for _ in range(30):
            trial = z + step * (target - z)
            reached = forces_at(model, sequence, trial).cost
            if reached <= cost + 1e-13 * abs(cost):
                z, cost = trial, reached
                break
            step *= 0.5
        else:
            return z, moved, count
    return z, moved, rounds
