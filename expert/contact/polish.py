"""Drive a plan to a stationary point at fixed modes, so that a differentiable layer has the same optimum.

Successive convex programs with the torque to first order, (p0 - q) x lambda + (p - p0) x lambda0; forces are recomputed
exactly at the new positions and steps are halved until the true cost falls.  Any Karush-Kuhn-Tucker point of the task at
fixed modes is a fixed point, and the minimiser of its own convex program.  Where these programs zigzag, because they do
not see the curvature of the torque, Newton's method on the active constraints finishes.  Everything is without
dimension, see `scaled`.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from expert.contact.box import pushes
from expert.contact.plan_at import forces_at
from expert.contact.scaled import ScaledTask
from expert.contact.sequence import Sequence, nearest_region, standing_rows
from expert.contact.steps import RIDGE, rays_per_end, solve_step, step_program
from expert.geometry.pose import Array
from expert.numeric.qp import SOLVED, compiled, solve_qp
from expert.world.values import IntArray

STATIONARY = 1e-9
"""A plan is stationary when its own convex program moves no variable by more (rho, and lengths in L)."""
PROXIMAL = 1e-6
"""Curvature, relative to the smoothing weight, towards the current point: settles flat directions, moves no fixed point."""
MENDINGS, AROUND = 6, 0.01
"""Programs that look for a plan near hopeless positions, and the width of rho around these that gives first forces."""
ROUNDS, PATIENCE, HALVINGS = 60, 8, 25
"""Convex programs in all, those before Newton's method is tried, and step lengths tried after each."""


class Program(NamedTuple):
    """The convex program at a point, over z and all ray weights: min v'Hv/2 + g'v, A v = b (first rows), A v >= b.

    first (T + 1,): where each step's ray weights start; torque (T,): row of its torque balance, -1 for none.
    """

    H: Array
    g: Array
    A: Array
    b: Array
    equalities: int
    first: IntArray
    torque: IntArray


@dataclass(frozen=True)
class Polished:
    """z, its cost, how far the last convex program moved it, and how many were solved."""

    z: Array
    cost: float
    moved: float
    rounds: int


def polish(scaled: ScaledTask, sequence: Sequence, z: Array) -> Polished:
    """Stationary point reached downhill from z."""
    forces = forces_at(scaled, sequence, z)
    cost = forces.cost
    moves: list[float] = []
    while len(moves) < ROUNDS and not _stuck(moves):
        program = first_order(scaled, sequence, z, forces.weights, settle_regions(scaled, sequence, z))
        status, v, u = solve_qp(
            program.H, program.g, program.A, program.b, program.equalities, 4 * scaled.iterations
        )
        if status != SOLVED:
            break
        moves.append(float(np.abs(v[: len(z)] - z).max(initial=0.0)))
        if moves[-1] <= STATIONARY:
            break
        steps = [z + 0.5**k * (v[: len(z)] - z) for k in range(HALVINGS)]
        if len(moves) > PATIENCE:
            here = np.concatenate([z, *_used(program, forces.weights)])
            steps.insert(0, _inside(sequence, newton(scaled, sequence, program, here, u)[: len(z)]))
        for trial in steps:
            reached = forces_at(scaled, sequence, trial)
            if reached.cost <= cost + 1e-13 * abs(cost):
                z, cost, forces = trial, reached.cost, reached
                break
        else:
            break
    return Polished(z, cost, moves[-1] if moves else np.inf, len(moves))


def mend(scaled: ScaledTask, sequence: Sequence, z: Array) -> tuple[Array, float]:
    """A plan near positions that admit none: first-order programs from the forces that positions close by would take.

    Free fingers go to the region that they miss least.  Returns the positions and their cost, inf without success.
    """
    weights = forces_around(scaled, sequence, z, AROUND)
    for _ in range(MENDINGS):
        program = first_order(scaled, sequence, z, weights, settle_regions(scaled, sequence, z))
        status, v, _ = solve_qp(
            program.H, program.g, program.A, program.b, program.equalities, 4 * scaled.iterations
        )
        if status != SOLVED:
            break
        before, z = z, _inside(sequence, v[: len(z)])
        cost = forces_at(scaled, sequence, z).cost
        if np.isfinite(cost):
            return z, cost
        if np.abs(z - before).max() <= STATIONARY:
            break
        for t in range(len(weights)):
            used = v[program.first[t] : program.first[t + 1]]
            weights[t, : len(used)] = np.maximum(used, 0.0)
    return z, np.inf


@compiled
def forces_around(scaled: ScaledTask, sequence: Sequence, z: Array, distance: float) -> Array:
    """Ray weights (T, N) of the least-cost forces with every rho free to move by `distance` at each step; 0: none."""
    T, C = sequence.modes.shape
    each = rays_per_end(scaled)
    weights = np.zeros((T, 3 * C + scaled.rays.shape[1]))
    for t in range(T):
        on = pushes(sequence, t)
        lo = np.maximum(z[on] - distance, sequence.lo[on])
        hi = np.minimum(z[on] + distance, sequence.hi[on])
        status, _, _, _, x = solve_step(scaled, t, sequence.facet[on], lo, hi)
        if status == SOLVED:
            k = 0
            for i in range(on.size):
                for _ in range(1 if lo[i] == hi[i] else 2):
                    for j in range(each):
                        weights[t, each * i + j] += max(x[k], 0.0)
                        k += 1
            for e in range(x.size - k):
                weights[t, each * on.size + e] = max(x[k + e], 0.0)
    return weights


def _stuck(moves: list[float]) -> bool:
    """Near a stationary point, but no nearer over the last rounds: rounding is all that moves it."""
    return len(moves) > 2 * PATIENCE and min(moves[-PATIENCE:]) > 0.5 * min(moves[:-PATIENCE])


def _used(program: Program, weights: Array) -> list[Array]:
    return [weights[t, : program.first[t + 1] - program.first[t]] for t in range(len(weights))]


def _inside(sequence: Sequence, z: Array) -> Array:
    rho = np.clip(z[: len(sequence.lo)], sequence.lo, sequence.hi)
    return np.concatenate([rho, z[len(rho) :]])


@compiled
def settle_regions(scaled: ScaledTask, sequence: Sequence, z: Array) -> IntArray:
    """Region with most room around each free finger, (T, C); -1 elsewhere."""
    assigned = np.full(sequence.modes.shape, -1)
    for t in range(assigned.shape[0]):
        for c in range(assigned.shape[1]):
            v = sequence.free[t, c]
            if v >= 0:
                assigned[t, c], _ = nearest_region(scaled, t, z[v], z[v + 1])
    return assigned


@compiled
def first_order(
    scaled: ScaledTask, sequence: Sequence, z: Array, weights: Array, assigned: IntArray
) -> Program:
    """The convex program with the torque expanded to first order at z and its forces; both are held by a proximal term."""
    T, n, each = len(sequence.modes), z.size, rays_per_end(scaled)
    standing, side = standing_rows(scaled, sequence, sequence.lo, sequence.hi, assigned, n)
    first, torque = np.full(T + 1, n), np.full(T, -1)
    balances, rows = 0, side.size
    for t in range(T):
        on = pushes(sequence, t)
        _, g, _, b = step_program(scaled, t, sequence.facet[on], z[on], z[on])
        first[t + 1] = first[t] + g.size
        if g.size > 0:
            balances, rows = balances + 3, rows + b.size
    width = first[T]
    H, g, A, b = np.zeros((width, width)), np.zeros(width), np.zeros((rows, width)), np.zeros(rows)
    H[:n, :n] = sequence.Q
    proximal = PROXIMAL * (1 + scaled.acceleration_weight)
    for i in range(n):
        H[i, i] += proximal
        g[i] = sequence.q[i] - proximal * z[i]
    A[balances : balances + side.size, :n] = standing
    b[balances : balances + side.size] = side
    top, row = 0, balances + side.size
    for t in range(T):
        on = pushes(sequence, t)
        h, c, a, s = step_program(scaled, t, sequence.facet[on], z[on], z[on])
        if c.size == 0:
            continue
        span = slice(first[t], first[t + 1])
        H[span, span] = h
        g[span] = c - RIDGE * weights[t, : c.size]
        A[top : top + 3, span] = a[:3]
        b[top : top + 3] = s[:3]
        torque[t] = top + 2
        for i in range(on.size):
            arm = scaled.length[sequence.facet[on[i]]] * weights[t, each * i : each * (i + 1)].sum()
            A[top + 2, on[i]] += arm
            b[top + 2] += arm * z[on[i]]
        A[row : row + s.size - 3, span] = a[3:]
        b[row : row + s.size - 3] = s[3:]
        top, row = top + 3, row + s.size - 3
    return Program(H, g, A, b, balances, first, torque)


def newton(scaled: ScaledTask, sequence: Sequence, program: Program, v: Array, u: Array) -> Array:
    """One Newton step from v on the constraints that the convex program's multipliers u find active, curved torque included."""
    active = np.arange(len(u)) < program.equalities
    active |= u > 1e-10 * max(1.0, np.abs(u).max(initial=0.0))
    bent = curvature(scaled, sequence, program, u)
    A = program.A[active]
    dependent = -1e-12 * np.eye(len(A))  # active constraints may depend on one another
    matrix = np.block([[program.H + bent, A.T], [A, dependent]])
    right = np.concatenate([bent @ v - program.g, program.b[active]])
    try:
        return np.linalg.solve(matrix, right)[: len(v)]
    except np.linalg.LinAlgError:
        return v


def curvature(scaled: ScaledTask, sequence: Sequence, program: Program, u: Array) -> Array:
    """Second derivative of the Lagrangian's torque terms, -u_tau l d(rho) d(lambda_n)."""
    bent, each = np.zeros_like(program.H), rays_per_end(scaled)
    for t, row in enumerate(program.torque):
        for i, k in enumerate(pushes(sequence, t)):
            rays = program.first[t] + np.arange(each * i, each * (i + 1))
            bent[k, rays] -= u[row] * scaled.length[sequence.facet[k]]
    return bent + bent.T
