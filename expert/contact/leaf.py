"""A complete mode sequence over a box of contact positions rho: certified lower bound and best plan found.

For fixed rho the task is a convex program that falls apart by step: cost(rho) = smoothing(rho) + sum_t phi_t(rho).  Each
phi_t is bounded below on the box by cuts: for multipliers y of its wrench balance, phi_t(rho) >= y.required - environment
- sum_c h_c(rho_c), and since h_c is convex in rho_c, its chord over the box makes the cut linear.  The master program
minimises smoothing plus cuts; its solution is evaluated exactly, which gives new multipliers.  (Kelley's method with
chords for tangents.)
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from expert.contact.model import Model
from expert.contact.qp import INFEASIBLE, SOLVED, solve_qp
from expert.contact.sequence import (
    FLAT,
    Sequence,
    least_over_box,
    smoothing,
    standing_rows,
    worst_intrusion,
)
from expert.contact.steps import CERTAIN, environment_reach, gain, reach, solve_step, tighten
from expert.geometry.pose import Array
from expert.types import IntArray

THETA_RIDGE = 1e-8
"""Curvature of the variables that stand for the steps' costs; the bound is recomputed without it."""


class Relaxed(NamedTuple):
    """Lower bound over the box (inf: proved empty); best plan (cost inf: none) at z; where to branch.

    intrusion: step, finger, depth of the free finger deepest inside the object at the last master solution, `last`.
    chord_error (K,): how far the chords miss, by interval.  program solved `count` times.
    """

    bound: float
    cost: float
    z: Array
    last: Array
    intrusion: tuple[int, int, float]
    chord_error: Array
    count: int


@njit(cache=True)
def pushes(sequence: Sequence, t: int) -> IntArray:
    """Intervals whose finger may push at t: those that go on, all at the last step."""
    S, C = sequence.modes.shape
    out, n = np.empty(C, np.int64), 0
    for c in range(C):
        k = sequence.interval[t, c]
        if k >= 0 and (t == S - 1 or sequence.interval[t + 1, c] == k):
            out[n] = k
            n += 1
    return out[:n]


@njit(cache=True)
def narrow(model: Model, sequence: Sequence, lo: Array, hi: Array) -> bool:
    """Tighten the box to contact positions from which every step can be balanced.  False: proved empty."""
    for _ in range(2):
        before = (hi - lo).sum()
        for t in range(len(sequence.modes)):
            on = pushes(sequence, t)
            if on.size == 0:
                continue
            low, high = lo[on], hi[on]
            for i in range(on.size):
                for end in range(2):
                    if low[i] < high[i] and not tighten(model, t, sequence.facet[on], low, high, i, end):
                        return False
            for i in range(on.size):
                lo[on[i]], hi[on[i]] = low[i], high[i]
                if low[i] > high[i]:
                    return False
        if (hi - lo).sum() > 0.8 * before:
            break
    return True


@njit(cache=True)
def support(model: Model, t: int, f: int, rho: float, y: Array, proof: bool) -> float:
    """h(rho) for a bound on the cost, or `reach` for a proof that there is no balance; both convex in rho."""
    return reach(model, t, f, rho, y) if proof else gain(model, t, f, rho, y)


@njit(cache=True)
def cut_row(
    model: Model, sequence: Sequence, t: int, lo: Array, hi: Array, y: Array, proof: bool, row: Array
) -> float:
    """Fill `row` over rho with chords; returns the right side of (theta_t +) row.rho >= side.

    proof: y shows that some rho admits no balance, and the cut says so: sum_c reach_c(rho) >= what is missing.
    """
    row[:] = 0.0
    side = model.required[t] @ y - environment_reach(model, t, y)
    for k in pushes(sequence, t):
        f = sequence.facet[k]
        low, high = support(model, t, f, lo[k], y, proof), support(model, t, f, hi[k], y, proof)
        slope = (high - low) / (hi[k] - lo[k]) if hi[k] > lo[k] else 0.0
        row[k] += slope
        side -= max(low, high) if slope == 0.0 else low - slope * lo[k]
    return side - CERTAIN if proof else side


@njit(cache=True)
def relax(
    model: Model,
    sequence: Sequence,
    lo: Array,
    hi: Array,
    assigned: IntArray,
    target: float,
    gap: float,
    rounds: int,
) -> Relaxed:
    """Alternate master program and exact evaluation; stop once the gap closes or the bound exceeds `target`."""
    T, C = sequence.modes.shape
    n, K = sequence.size, lo.size
    width = n + T
    base_A, base_b = standing_rows(model, sequence, lo, hi, assigned, width)
    most = base_b.size + T * (rounds + 1)
    A, b, theta = np.zeros((most, width)), np.zeros(most), np.full(most, -1)
    A[: base_b.size], b[: base_b.size] = base_A, base_b
    m, count = base_b.size, 0
    H, g = np.zeros((width, width)), np.zeros(width)
    ridge = FLAT * (1 + model.acceleration_weight)
    H[:n, :n] = sequence.Q
    for i in range(n):
        H[i, i] += ridge
    g[:n] = sequence.q - ridge * sequence.reference
    for t in range(T):
        H[n + t, n + t] = THETA_RIDGE
        g[n + t] = 1.0
    last_y, proofs = np.zeros((T, 3)), np.zeros(T, np.bool_)
    best, z, bound = np.inf, sequence.reference, -np.inf
    error, nowhere = np.zeros(K), (-1, -1, 0.0)
    for t in range(T):
        on = pushes(sequence, t)
        status, _, value, y, _ = solve_step(model, t, sequence.facet[on], lo[on], hi[on])
        count += 1
        if status == INFEASIBLE:
            return Relaxed(np.inf, np.inf, z, z, nowhere, error, count)
        b[m] = cut_row(model, sequence, t, lo, hi, y, False, A[m, :K])
        A[m, n + t], theta[m] = 1.0, t
        m += 1
        last_y[t] = y
    last, intrusion = z, nowhere
    for _ in range(rounds):
        status, x, u = solve_qp(H, g, A[:m], b[:m], 0, model.iterations)
        count += 1
        if status == INFEASIBLE:
            if empty(model, A[:m], b[:m], u, theta, lo, hi, n):
                return Relaxed(np.inf, best, z, last, nowhere, error, count)
            break
        if status != SOLVED:
            break
        last = x[:n].copy()
        for k in range(K):
            last[k] = min(max(last[k], lo[k]), hi[k])
        before = bound
        bound = max(bound, safe_bound(model, sequence, last, A[:m], b[:m], u, theta, lo, hi, T))
        intrusion = worst_intrusion(model, sequence, last, assigned)
        if bound >= target:
            break
        total, feasible = smoothing(sequence, last), True
        for t in range(T):
            on = pushes(sequence, t)
            rho = last[on]
            status, cost, value, y, _ = solve_step(model, t, sequence.facet[on], rho, rho)
            count += 1
            total += cost
            proofs[t] = status == INFEASIBLE
            feasible &= status == SOLVED
            b[m] = cut_row(model, sequence, t, lo, hi, y, proofs[t], A[m, :K])
            if not proofs[t]:
                A[m, n + t], theta[m] = 1.0, t
            last_y[t] = y
            m += 1
        if feasible and intrusion[2] == 0.0 and total < best:
            best, z = total, last
        if feasible and total - bound <= gap * abs(total):
            break
        if (
            bound - before < 0.2 * (min(best, total) - bound)
            and before > -np.inf
            and min(best, total) < np.inf
        ):
            break
    for t in range(T):
        for k in pushes(sequence, t):
            f, width_k = sequence.facet[k], hi[k] - lo[k]
            if width_k > 0:
                s = (last[k] - lo[k]) / width_k
                low = support(model, t, f, lo[k], last_y[t], proofs[t])
                high = support(model, t, f, hi[k], last_y[t], proofs[t])
                here = support(model, t, f, last[k], last_y[t], proofs[t])
                error[k] += (1 - s) * low + s * high - here
    return Relaxed(bound, best, z, last, intrusion, error, count)


@njit(cache=True)
def safe_bound(
    model: Model,
    sequence: Sequence,
    z: Array,
    A: Array,
    b: Array,
    u: Array,
    theta: IntArray,
    lo: Array,
    hi: Array,
    T: int,
) -> float:
    """Weak duality at any multipliers: no plan in the box costs less, whatever the solver's tolerance."""
    n = z.size
    total = np.zeros(T)
    for i in range(b.size):
        if theta[i] >= 0:
            total[theta[i]] += max(u[i], 0.0)
    slope = sequence.Q @ z + sequence.q
    bound = smoothing(sequence, z)
    for i in range(b.size):
        weight = max(u[i], 0.0)
        if theta[i] >= 0:  # the multipliers of a step's cuts must add up to one
            if total[theta[i]] <= 0.0:
                return -np.inf
            weight /= total[theta[i]]
        if weight > 0.0:
            bound += weight * (b[i] - A[i, :n] @ z)
            slope -= weight * A[i, :n]
    return bound + least_over_box(model, z, slope, lo, hi)


@njit(cache=True)
def empty(model: Model, A: Array, b: Array, u: Array, theta: IntArray, lo: Array, hi: Array, n: int) -> bool:
    """Whether multipliers prove that no z in the box satisfies the rows without a step's cost."""
    row, side = np.zeros(n), 0.0
    for i in range(b.size):
        if theta[i] < 0 and u[i] > 0:
            row -= u[i] * A[i, :n]
            side += u[i] * b[i]
    zero = np.zeros(n)
    return side + least_over_box(model, zero, row, lo, hi) > 1e-9 * (1 + u.max())
