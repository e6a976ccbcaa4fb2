"""Drive a plan to a stationary point at fixed modes, so that a differentiable layer has the same optimum.

Successive convex programs with the torque to first order, (p0 - q) x lambda + (p - p0) x lambda0; forces are recomputed
exactly at the new positions and steps are halved until the true cost falls.  Any Karush-Kuhn-Tucker point of the task at
fixed modes is a fixed point, and the minimiser of its own convex program.  Where these programs zigzag, because they do
not see the curvature of the torque, Newton's method on the active constraints finishes.  Everything is without
dimension, see `scaled`.
"""

from dataclasses import dataclass

import numpy as np

from expert.budget import Budget
from expert.contact.first_order import Program, curvature, first_order
from expert.contact.plan_at import forces_at
from expert.contact.scaled import ScaledTask
from expert.contact.sequence import Sequence, ranging
from expert.contact.steps import Stance, rays_per_end, solve_step
from expert.geometry.pose import Array
from expert.numeric.qp import SOLVED, compiled, solve_qp

STATIONARY = 1e-9
"""A plan is stationary when its own convex program moves no variable by more (rho, and lengths in L)."""
MENDINGS, AROUND = 6, 0.01
"""Programs that look for a plan near hopeless positions, and the width of rho around these that gives first forces."""
ROUNDS, PATIENCE, HALVINGS = 60, 8, 25
"""Convex programs in all, those before Newton's method is tried, and step lengths tried after each."""


@dataclass(frozen=True)
class Polished:
    """z, its cost, how far the last convex program moved it, and how many were solved."""

    z: Array
    cost: float
    moved: float
    rounds: int


def polish(scaled: ScaledTask, sequence: Sequence, z: Array, budget: Budget) -> Polished:
    """Stationary point reached downhill from z, or how far the budget leads."""
    forces = forces_at(scaled, sequence, z)
    cost = forces.cost
    moves: list[float] = []
    while len(moves) < ROUNDS and not _stuck(moves) and not budget.over:
        program = first_order(scaled, sequence, z, forces.weights)
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


def mend(scaled: ScaledTask, sequence: Sequence, z: Array, budget: Budget) -> tuple[Array, float]:
    """A plan near positions that admit none: first-order programs from the forces that positions close by would take.

    Free fingers go to the region that they miss least.  Returns the positions and their cost, inf without success.
    """
    weights = forces_around(scaled, sequence, z, AROUND)
    for _ in range(MENDINGS):
        if budget.over:
            break
        program = first_order(scaled, sequence, z, weights)
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
    weights = np.zeros((T, 3 * C + scaled.rays.shape[1]))
    rho = z[: sequence.lo.size]
    lo, hi = np.maximum(rho - distance, sequence.lo), np.minimum(rho + distance, sequence.hi)
    for t in range(T):
        stance = ranging(sequence, t, lo, hi)
        found = solve_step(scaled, stance)
        if found.status == SOLVED:
            add_ends(scaled, stance, found.x, weights[t])
    return weights


@compiled
def add_ends(scaled: ScaledTask, stance: Stance, x: Array, weights: Array) -> None:
    """Add the weights of each finger's rays at both ends of its range; the environment's follow."""
    each, k = rays_per_end(scaled), 0
    for i in range(stance.facets.size):
        for _ in range(1 if stance.lo[i] == stance.hi[i] else 2):
            for j in range(each):
                weights[each * i + j] += max(x[k], 0.0)
                k += 1
    for e in range(x.size - k):
        weights[each * stance.facets.size + e] = max(x[k + e], 0.0)


def _stuck(moves: list[float]) -> bool:
    """Near a stationary point, but no nearer over the last rounds: rounding is all that moves it."""
    return len(moves) > 2 * PATIENCE and min(moves[-PATIENCE:]) > 0.5 * min(moves[:-PATIENCE])


def _used(program: Program, weights: Array) -> list[Array]:
    return [weights[t, : program.first[t + 1] - program.first[t]] for t in range(len(weights))]


def _inside(sequence: Sequence, z: Array) -> Array:
    rho = np.clip(z[: len(sequence.lo)], sequence.lo, sequence.hi)
    return np.concatenate([rho, z[len(rho) :]])


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
