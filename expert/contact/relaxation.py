"""A complete mode sequence over a box of contact positions rho: certified lower bound and best plan found.

For fixed rho the task is a convex program that falls apart by step: cost(rho) = smoothing(rho) + sum_t phi_t(rho).  Each
phi_t is bounded below on the box by cuts: for multipliers y of its wrench balance, phi_t(rho) >= y.required - environment
- sum_c h_c(rho_c), and since h_c is convex in rho_c, its chord over the box makes the cut linear.  The master program
minimises smoothing plus cuts; its solution is evaluated exactly, which gives new multipliers.  (Kelley's method with
chords for tangents.)
"""

from typing import NamedTuple

import numpy as np

from expert.contact.box import Box, standing_rows, worst_intrusion
from expert.contact.master import Cut, Master, blend, empty, safe_bound, solve_master
from expert.contact.scaled import ScaledTask
from expert.contact.sequence import accelerations, fixed, pushes, ranging, smoothing
from expert.contact.smoothing import FLAT
from expert.contact.steps import CERTAIN, environment_reach, gain, reach, shortfall, solve_step
from expert.geometry.pose import Array
from expert.numeric.qp import INFEASIBLE, SOLVED, compiled, inlined

THETA_RIDGE = 1e-8
"""Curvature of the variables that stand for the steps' costs; the bound is recomputed without it."""
WORTH = 0.3
"""Share of the gap that a new cut must promise to close; below, the chords are too coarse and the box is split."""
NEARBY = 1e-5
"""Where a step has no balance, the cost within this distance of rho gives a second cut: forces grow huge before they fail."""


class Relaxed(NamedTuple):
    """Lower bound over the box (inf: proved empty) and its share from forces; best plan (cost inf: none) at z.

    What proves the bound: multipliers y (T, 3) of the wrench balances and accelerations (T - 2, C, 2) at which the smoothing
    cost is linearised.  intrusion: step, finger, depth of the free finger deepest inside the object at the last master
    solution, `last`.  chord_error (K,): how far the chords miss there, by interval.
    """

    bound: float
    y: Array
    accelerations: Array
    forces: float
    cost: float
    z: Array
    last: Array
    intrusion: tuple[int, int, float]
    chord_error: Array


class Goal(NamedTuple):
    """When to stop: bound at or above `target`, relative `gap` closed, or so many `rounds` of the master program."""

    target: float
    gap: float
    rounds: int


@inlined
def open_master(scaled: ScaledTask, box: Box, rounds: int) -> Master:
    """The program without cuts."""
    sequence = box.sequence
    T, n = len(sequence.modes), sequence.size
    rows, side = standing_rows(scaled, box, n + T)
    most = side.size + T * (2 * rounds + 1)
    A, b, step = np.zeros((most, n + T)), np.zeros(most), np.full(most, -1)
    A[: side.size], b[: side.size] = rows, side
    H, g = np.zeros((n + T, n + T)), np.ones(n + T)
    H[:n, :n] = sequence.Q
    for i in range(n + T):
        H[i, i] += FLAT * (1 + scaled.acceleration_weight) if i < n else THETA_RIDGE
    no_proof, y, filled = np.zeros(most, np.bool_), np.zeros((most, 3)), np.array([side.size])
    master = Master(H, g, A, b, step, no_proof, y, filled)
    hold_near(scaled, box, master, sequence.reference)
    return master


@inlined
def hold_near(scaled: ScaledTask, box: Box, master: Master, z: Array) -> None:
    """Let the curvature of flat directions pull towards z.  At the next solution it pulls at little, and costs the bound little."""
    ridge = FLAT * (1 + scaled.acceleration_weight)
    for i in range(z.size):
        master.g[i] = box.sequence.q[i] - ridge * z[i]


@inlined
def within(box: Box, x: Array) -> Array:
    """z of a solution (z, theta), with rho in the box."""
    z = x[: box.sequence.size].copy()
    for k in range(box.lo.size):
        z[k] = min(max(z[k], box.lo[k]), box.hi[k])
    return z


@compiled
def support(scaled: ScaledTask, cut: Cut, f: int, rho: float) -> float:
    """h(rho) for a bound on the cost, or `reach` for a proof that there is no balance; both convex in rho."""
    return reach(scaled, cut.t, f, rho, cut.y) if cut.proof else gain(scaled, cut.t, f, rho, cut.y)


@compiled
def add_cut(scaled: ScaledTask, box: Box, master: Master, cut: Cut) -> None:
    """theta_t >= D(y) with chords for h; or, with a proof y that some rho admits no balance, what rules it out."""
    i = master.filled[0]
    row = master.A[i]
    side = scaled.required[cut.t] @ cut.y - environment_reach(scaled, cut.t, cut.y)
    for k in pushes(box.sequence, cut.t):
        f, width = box.sequence.facet[k], box.hi[k] - box.lo[k]
        low, high = support(scaled, cut, f, box.lo[k]), support(scaled, cut, f, box.hi[k])
        if width > 0:
            slope = (high - low) / width
            row[k] += slope
            side -= low - slope * box.lo[k]
        else:
            side -= max(low, high)
    master.b[i] = side - CERTAIN if cut.proof else side
    master.step[i], master.proof[i], master.y[i] = cut.t, cut.proof, cut.y
    if not cut.proof:
        row[box.sequence.size + cut.t] = 1.0
    master.filled[0] += 1


@compiled
def add_chord_error(scaled: ScaledTask, box: Box, cut: Cut, z: Array, error: Array) -> None:
    """Add to `error`, by interval, how far the chords of a cut miss at z."""
    for k in pushes(box.sequence, cut.t):
        f, width = box.sequence.facet[k], box.hi[k] - box.lo[k]
        if width > 0:
            low, high = support(scaled, cut, f, box.lo[k]), support(scaled, cut, f, box.hi[k])
            error[k] += low + (high - low) / width * (z[k] - box.lo[k]) - support(scaled, cut, f, z[k])


@compiled
def relax(scaled: ScaledTask, box: Box, goal: Goal) -> Relaxed:
    """Alternate master program and exact evaluation until the gap closes, the bound exceeds the target or chords dominate."""
    sequence, lo = box.sequence, box.lo
    T, C = sequence.modes.shape
    master = open_master(scaled, box, goal.rounds)
    forces, y = force_bound(scaled, box, master)
    slopes, error = np.zeros((max(T - 2, 0), C, 2)), np.zeros(lo.size)
    z, last, cost, intrusion = sequence.reference, sequence.reference, np.inf, (-1, -1, 0.0)
    if forces == np.inf:
        return Relaxed(np.inf, y, slopes, forces, cost, z, last, intrusion, error)
    bound, weights, tangent = -np.inf, np.zeros(0), z
    for _ in range(goal.rounds):
        status, x, u = solve_master(scaled, master)
        if status == INFEASIBLE and empty(scaled, box, master, u):
            bound, weights = np.inf, u
            break
        if status != SOLVED:
            break
        last = within(box, x)
        hold_near(scaled, box, master, last)
        here = safe_bound(scaled, box, master, last, u)
        if here > bound:
            bound, weights, tangent = here, u, last
        intrusion = worst_intrusion(scaled, box, last)
        if bound >= goal.target:
            break
        error[:] = 0.0
        here, missing = evaluate(scaled, box, master, last, error)
        if here < cost and intrusion[2] == 0.0:
            cost, z = here, last
        distance = missing if missing > 0.0 else here - bound
        if missing == 0.0 and distance <= goal.gap * abs(here):
            break
        if distance - error.sum() <= WORTH * distance:
            break
    if weights.size > 0:
        y, slopes = blend(master, weights, bound == np.inf, T), accelerations(sequence, tangent)
    return Relaxed(bound, y, slopes, forces, cost, z, last, intrusion, error)


@inlined
def force_bound(scaled: ScaledTask, box: Box, master: Master) -> tuple[float, Array]:
    """Sum of the steps' least force costs anywhere in the box, each of which becomes a cut, and the multipliers (T, 3) that
    prove it; inf: a step has no balance."""
    T = len(box.sequence.modes)
    total, y = 0.0, np.zeros((T, 3))
    for t in range(T):
        least = solve_step(scaled, ranging(box.sequence, t, box.lo, box.hi))
        if least.status == INFEASIBLE:
            y[:] = 0.0
            y[t] = least.y
            total = np.inf
            break
        y[t] = least.y
        total += least.bound
        add_cut(scaled, box, master, Cut(t, least.y, False))
    return total, y


@inlined
def evaluate(scaled: ScaledTask, box: Box, master: Master, z: Array, error: Array) -> tuple[float, float]:
    """Exact cost at z (inf: some step has no balance, which misses by the second value), adding each step's cut.

    error: how far the chords miss, over the steps without balance if there are any.
    """
    cost, missing = smoothing(box.sequence, z), 0.0
    rho = z[: box.lo.size]
    low, high = np.maximum(rho - NEARBY, box.lo), np.minimum(rho + NEARBY, box.hi)
    for t in range(len(box.sequence.modes)):
        stance = fixed(box.sequence, t, z)
        here = solve_step(scaled, stance)
        cost += here.cost
        cut = Cut(t, here.y, here.status == INFEASIBLE)
        if cut.proof:
            if missing == 0.0:
                error[:] = 0.0
            missing += shortfall(scaled, stance, here.y)
            near = solve_step(scaled, ranging(box.sequence, t, low, high))
            if near.status == SOLVED:
                add_cut(scaled, box, master, Cut(t, near.y, False))
        add_cut(scaled, box, master, cut)
        if cut.proof or missing == 0.0:
            add_chord_error(scaled, box, cut, z, error)
    return cost, missing
