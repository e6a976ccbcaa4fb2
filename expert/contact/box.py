"""A complete mode sequence over a box of contact positions rho: certified lower bound and best plan found.

For fixed rho the task is a convex program that falls apart by step: cost(rho) = smoothing(rho) + sum_t phi_t(rho).  Each
phi_t is bounded below on the box by cuts: for multipliers y of its wrench balance, phi_t(rho) >= y.required - environment
- sum_c h_c(rho_c), and since h_c is convex in rho_c, its chord over the box makes the cut linear.  The master program
minimises smoothing plus cuts; its solution is evaluated exactly, which gives new multipliers.  (Kelley's method with
chords for tangents.)
"""

from typing import NamedTuple

import numpy as np

from expert.contact.scaled import ScaledTask
from expert.contact.sequence import (
    FLAT,
    Sequence,
    least_over_box,
    smoothing,
    standing_rows,
    worst_intrusion,
)
from expert.contact.steps import CERTAIN, environment_reach, gain, reach, shortfall, solve_step, tighten
from expert.geometry.pose import Array
from expert.numeric.qp import INFEASIBLE, SOLVED, compiled, solve_qp
from expert.world.values import IntArray

THETA_RIDGE = 1e-8
"""Curvature of the variables that stand for the steps' costs; the bound is recomputed without it."""
WORTH = 0.3
"""Share of the gap that a new cut must promise to close; below, the chords are too coarse and the box is split."""
ROUNDING = 1e-12
"""Relative size of the terms of a proof that rounding may have made up."""
NEARBY = 1e-5
"""Where a step has no balance, the cost within this distance of rho gives a second cut: forces grow huge before they fail."""


class Relaxed(NamedTuple):
    """Lower bound over the box (inf: proved empty) and its share from forces; best plan (cost inf: none) at z.

    intrusion: step, finger, depth of the free finger deepest inside the object at the last master solution, `last`.
    chord_error (K,): how far the chords miss there, by interval.
    """

    bound: float
    forces: float
    cost: float
    z: Array
    last: Array
    intrusion: tuple[int, int, float]
    chord_error: Array


class Master(NamedTuple):
    """Minimise smoothing(z) + sum of theta_t subject to rows A (z, theta) >= b; room for more rows.

    step: which theta a row bounds, -1 for none.  filled (1,): rows in use.
    """

    H: Array
    g: Array
    A: Array
    b: Array
    step: IntArray
    filled: IntArray


@compiled
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


@compiled
def narrow(scaled: ScaledTask, sequence: Sequence, lo: Array, hi: Array) -> bool:
    """Tighten the box to contact positions from which every step can be balanced.  False: proved empty."""
    for _ in range(2):
        before = (hi - lo).sum()
        for t in range(len(sequence.modes)):
            on = pushes(sequence, t)
            low, high = lo[on], hi[on]
            for i in range(on.size):
                for end in range(2):
                    if low[i] < high[i] and not tighten(scaled, t, sequence.facet[on], low, high, i, end):
                        return False
                lo[on[i]], hi[on[i]] = low[i], high[i]
                if low[i] > high[i]:
                    return False
        if (hi - lo).sum() > 0.8 * before:
            break
    return True


@compiled
def support(scaled: ScaledTask, t: int, f: int, rho: float, y: Array, proof: bool) -> float:
    """h(rho) for a bound on the cost, or `reach` for a proof that there is no balance; both convex in rho."""
    return reach(scaled, t, f, rho, y) if proof else gain(scaled, t, f, rho, y)


@compiled
def open_master(
    scaled: ScaledTask, sequence: Sequence, lo: Array, hi: Array, assigned: IntArray, rounds: int
) -> Master:
    """The program without cuts."""
    T, n = len(sequence.modes), sequence.size
    rows, side = standing_rows(scaled, sequence, lo, hi, assigned, n + T)
    most = side.size + T * (2 * rounds + 1)
    A, b, step = np.zeros((most, n + T)), np.zeros(most), np.full(most, -1)
    A[: side.size], b[: side.size] = rows, side
    H, g = np.zeros((n + T, n + T)), np.ones(n + T)
    ridge = FLAT * (1 + scaled.acceleration_weight)
    H[:n, :n] = sequence.Q
    g[:n] = sequence.q - ridge * sequence.reference
    for i in range(n + T):
        H[i, i] += ridge if i < n else THETA_RIDGE
    return Master(H, g, A, b, step, np.array([side.size]))


@compiled
def add_cut(
    scaled: ScaledTask,
    sequence: Sequence,
    master: Master,
    t: int,
    lo: Array,
    hi: Array,
    y: Array,
    proof: bool,
    at: Array,
    error: Array,
) -> None:
    """theta_t >= D(y) with chords for h; or, with a proof y that some rho admits no balance, what rules it out.

    Adds to `error`, by interval, how far the chords miss at `at`.
    """
    row = master.A[master.filled[0]]
    side = scaled.required[t] @ y - environment_reach(scaled, t, y)
    for k in pushes(sequence, t):
        f, width = sequence.facet[k], hi[k] - lo[k]
        low, high = support(scaled, t, f, lo[k], y, proof), support(scaled, t, f, hi[k], y, proof)
        if width > 0:
            slope = (high - low) / width
            row[k] += slope
            side -= low - slope * lo[k]
            error[k] += low + slope * (at[k] - lo[k]) - support(scaled, t, f, at[k], y, proof)
        else:
            side -= max(low, high)
    master.b[master.filled[0]] = side - CERTAIN if proof else side
    if not proof:
        row[sequence.size + t] = 1.0
        master.step[master.filled[0]] = t
    master.filled[0] += 1


@compiled
def relax(
    scaled: ScaledTask,
    sequence: Sequence,
    lo: Array,
    hi: Array,
    assigned: IntArray,
    target: float,
    gap: float,
    rounds: int,
) -> Relaxed:
    """Alternate master program and exact evaluation until the gap closes, the bound exceeds `target` or chords dominate."""
    T, n = len(sequence.modes), sequence.size
    master = open_master(scaled, sequence, lo, hi, assigned, rounds)
    z, last = sequence.reference, sequence.reference
    best, bound, forces = np.inf, -np.inf, 0.0
    intrusion, error = (-1, -1, 0.0), np.zeros(lo.size)
    for t in range(T):
        on = pushes(sequence, t)
        status, _, value, y, _ = solve_step(scaled, t, sequence.facet[on], lo[on], hi[on])
        if status == INFEASIBLE:
            return Relaxed(np.inf, np.inf, np.inf, z, z, intrusion, error)
        forces += value
        add_cut(scaled, sequence, master, t, lo, hi, y, False, lo, error)
    for _ in range(rounds):
        m = master.filled[0]
        A, b = master.A[:m], master.b[:m]
        status, x, u = solve_qp(master.H, master.g, A, b, np.int64(0), scaled.iterations)
        if status == INFEASIBLE and empty(scaled, master, u, lo, hi, n):
            return Relaxed(np.inf, forces, best, z, last, intrusion, error)
        if status != SOLVED:
            break
        last = x[:n].copy()
        last[: lo.size] = np.minimum(np.maximum(last[: lo.size], lo), hi)
        bound = max(bound, safe_bound(scaled, sequence, master, last, u, lo, hi))
        intrusion = worst_intrusion(scaled, sequence, last, assigned)
        if bound >= target:
            break
        error[:] = 0.0
        cost, missing = evaluate(scaled, sequence, master, last, lo, hi, error)
        if cost < best and intrusion[2] == 0.0:
            best, z = cost, last
        if missing == 0.0 and cost - bound <= gap * abs(cost):
            break
        distance = missing if missing > 0.0 else cost - bound
        if distance - error.sum() <= WORTH * distance:
            break
    return Relaxed(bound, forces, best, z, last, intrusion, error)


@compiled
def evaluate(
    scaled: ScaledTask, sequence: Sequence, master: Master, z: Array, lo: Array, hi: Array, error: Array
) -> tuple[float, float]:
    """Exact cost at z (inf: some step has no balance, which misses by the second value), adding each step's cut.

    error: how far the chords miss, over the steps without balance if there are any.
    """
    cost, missing, scratch = smoothing(sequence, z), 0.0, np.zeros(lo.size)
    for t in range(len(sequence.modes)):
        on = pushes(sequence, t)
        rho = z[on]
        status, value, _, y, _ = solve_step(scaled, t, sequence.facet[on], rho, rho)
        cost += value
        proof = status == INFEASIBLE
        if proof:
            if missing == 0.0:
                error[:] = 0.0
            missing += shortfall(scaled, t, sequence.facet[on], rho, rho, y)
            low, high = np.maximum(rho - NEARBY, lo[on]), np.minimum(rho + NEARBY, hi[on])
            near, _, _, around, _ = solve_step(scaled, t, sequence.facet[on], low, high)
            if near == SOLVED:
                add_cut(scaled, sequence, master, t, lo, hi, around, False, z, scratch)
        add_cut(
            scaled, sequence, master, t, lo, hi, y, proof, z, error if proof or missing == 0.0 else scratch
        )
    return cost, missing


@compiled
def safe_bound(
    scaled: ScaledTask, sequence: Sequence, master: Master, z: Array, u: Array, lo: Array, hi: Array
) -> float:
    """Weak duality at any multipliers: no plan in the box costs less, whatever the solver's tolerance."""
    n, total = z.size, np.zeros(len(sequence.modes))
    for i in range(u.size):
        if master.step[i] >= 0:
            total[master.step[i]] += max(u[i], 0.0)
    if total.min() <= 0.0:
        return -np.inf
    slope = sequence.Q @ z + sequence.q
    bound = smoothing(sequence, z)
    for i in range(u.size):
        if u[i] > 0.0:
            # the multipliers of a step's cuts must add up to one
            weight = u[i] / total[master.step[i]] if master.step[i] >= 0 else u[i]
            side = master.b[i]
            for j in range(n):
                side -= master.A[i, j] * z[j]
                slope[j] -= weight * master.A[i, j]
            bound += weight * side
    return bound + least_over_box(scaled, z, slope, lo, hi)


@compiled
def empty(scaled: ScaledTask, master: Master, u: Array, lo: Array, hi: Array, n: int) -> bool:
    """Whether multipliers prove, rounding aside, that no z in the box satisfies the rows that bound no theta."""
    row, side, size = np.zeros(n), 0.0, 0.0
    for i in range(u.size):
        if master.step[i] < 0 and u[i] > 0:
            row -= u[i] * master.A[i, :n]
            side += u[i] * master.b[i]
            size += u[i] * (abs(master.b[i]) + np.abs(master.A[i, :n]).sum())
    return side + least_over_box(scaled, np.zeros(n), row, lo, hi) > ROUNDING * size
