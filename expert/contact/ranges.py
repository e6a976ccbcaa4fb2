"""The range of rho from which a step can be balanced: what lies outside is cut off, piece by piece, each with its proof."""

from typing import NamedTuple

import numpy as np

from expert.contact.scaled import ScaledTask
from expert.contact.sequence import Sequence, pushes, ranging
from expert.contact.steps import CERTAIN, Stance, rays_per_end, reach, shortfall, solve_step
from expert.geometry.pose import Array
from expert.numeric.qp import INFEASIBLE, SOLVED, compiled, inlined
from expert.world.values import IntArray

CERTIFICATES, BISECTIONS = 4, 10
"""Steps by either means towards the end of a range of rho."""
LOW, HIGH, ALL = 0, 1, 2
"""Which part of a range was cut off."""
PASSES, WORTH = 2, 0.8
"""Passes over all steps, and the share of the box's width that must be left for there to be no other."""


class Pieces(NamedTuple):
    """Parts of a box that admit no balance, in the order in which they were cut off.

    Piece i is the LOW or HIGH part, up to at[i], of the range of interval[i], or ALL of the box that was left; multipliers y[i] (3,) of
    the wrench balance of step[i] prove it.  filled (1,): pieces in use.
    """

    step: IntArray
    interval: IntArray
    part: IntArray
    at: Array
    y: Array
    filled: IntArray


@inlined
def no_pieces(most: int) -> Pieces:
    """Room for so many pieces."""
    step, interval, part = np.zeros(most, np.int64), np.zeros(most, np.int64), np.zeros(most, np.int64)
    return Pieces(step, interval, part, np.zeros(most), np.zeros((most, 3)), np.zeros(1, np.int64))


@compiled
def narrow(scaled: ScaledTask, sequence: Sequence, lo: Array, hi: Array) -> tuple[bool, Pieces]:
    """Tighten the box to contact positions from which every step can be balanced, and what was cut off.  False: nothing is left."""
    T, C = sequence.modes.shape
    pieces = no_pieces(PASSES * T * C * 2 * (CERTIFICATES + 2))
    if (lo > hi).any():
        return False, pieces
    for _ in range(PASSES):
        before = (hi - lo).sum()
        for t in range(T):
            on = pushes(sequence, t)
            stance = ranging(sequence, t, lo, hi)
            for i in range(on.size):
                for end in (LOW, HIGH):
                    first = pieces.filled[0]
                    possible = stance.lo[i] == stance.hi[i] or tighten(scaled, stance, i, end, pieces)
                    pieces.interval[first : pieces.filled[0]] = on[i]
                    if not possible:
                        return False, pieces
                lo[on[i]], hi[on[i]] = stance.lo[i], stance.hi[i]
        if (hi - lo).sum() > WORTH * before:
            break
    return True, pieces


@inlined
def tighten(scaled: ScaledTask, stance: Stance, i: int, end: int, pieces: Pieces) -> bool:
    """Move the LOW or HIGH end of finger i's range in towards the first rho that admits a balance.  False: there is none.

    First by certificates: multipliers that prove one rho hopeless rule out its neighbours too.  Then by bisection: the
    rho of a convex set of (w, lambda_n) form an interval, so what lies beyond a hopeless rho is hopeless.
    """
    t, facets, lo, hi = stance
    far = hi[i] if end == LOW else lo[i]
    for _ in range(CERTIFICATES):
        near = lo[i] if end == LOW else hi[i]
        at = only(stance, i, near, near)
        there = solve_step(scaled, at)
        if there.status != INFEASIBLE:
            return True
        others = shortfall(scaled, at, there.y) + reach(scaled, t, facets[i], near, there.y) - CERTAIN
        if reach(scaled, t, facets[i], far, there.y) < others:
            cut_off(pieces, t, ALL, far, there.y)  # convex in rho: no rho in between reaches it either
            return False
        move(stance, i, end, first_reach(scaled, t, facets[i], near, far, there.y, others))
        cut_off(pieces, t, end, lo[i] if end == LOW else hi[i], there.y)
    possible, y = balanced_rho(scaled, stance, i)
    if possible == np.inf:
        cut_off(pieces, t, ALL, far, y)
        return False
    if possible >= 0:
        bisect(scaled, stance, i, end, possible, pieces)
    return True


@inlined
def only(stance: Stance, i: int, low: float, high: float) -> Stance:
    """The stance with finger i in another range."""
    t, facets, lo, hi = stance
    lo, hi = lo.copy(), hi.copy()
    lo[i], hi[i] = low, high
    return Stance(t, facets, lo, hi)


@inlined
def move(stance: Stance, i: int, end: int, to: float) -> None:
    """Move one end of finger i's range."""
    if end == LOW:
        stance.lo[i] = to
    else:
        stance.hi[i] = to


@inlined
def cut_off(pieces: Pieces, step: int, part: int, at: float, y: Array) -> None:
    """Record a piece; whoever asked for it adds its interval."""
    k = pieces.filled[0]
    pieces.step[k], pieces.part[k], pieces.at[k] = step, part, at
    pieces.y[k] = y
    pieces.filled[0] += 1


@inlined
def bisect(scaled: ScaledTask, stance: Stance, i: int, end: int, possible: float, pieces: Pieces) -> None:
    """Cut off what lies before `possible` and beyond a hopeless rho, if one set of multipliers proves all of it hopeless."""
    start = stance.lo[i] if end == LOW else stance.hi[i]
    near = start
    for _ in range(BISECTIONS):
        middle = 0.5 * (near + possible)
        if solve_step(scaled, only(stance, i, middle, middle)).status == INFEASIBLE:
            near = middle
        else:
            possible = middle
    if near != start:
        hopeless = solve_step(scaled, only(stance, i, min(start, near), max(start, near)))
        if hopeless.status == INFEASIBLE:
            move(stance, i, end, near)
            cut_off(pieces, stance.t, end, near, hopeless.y)


@inlined
def balanced_rho(scaled: ScaledTask, stance: Stance, i: int) -> tuple[float, Array]:
    """The rho of finger i in the least-cost balance over the box; -1: unknown, or any rho will do; inf: none exists, proved by y."""
    lo, hi = stance.lo, stance.hi
    found = solve_step(scaled, stance)
    if found.status != SOLVED:
        return np.inf if found.status == INFEASIBLE else -1.0, found.y
    each, k = rays_per_end(scaled), 0
    for j in range(i):
        k += each if lo[j] == hi[j] else 2 * each
    at_low, at_high = found.x[k : k + each].sum(), found.x[k + each : k + 2 * each].sum()
    if lo[i] == hi[i] or at_low + at_high <= 0:
        return -1.0, found.y
    return (at_low * lo[i] + at_high * hi[i]) / (at_low + at_high), found.y


@compiled
def first_reach(scaled: ScaledTask, t: int, f: int, rho: float, far: float, y: Array, wanted: float) -> float:
    """Where `reach`, convex with reach(rho) < wanted <= reach(far), attains `wanted`; never beyond that point."""
    short, long = rho, far
    for _ in range(60):
        middle = 0.5 * (short + long)
        if reach(scaled, t, f, middle, y) < wanted:
            short = middle  # convex: nothing between rho and here reaches it
        else:
            long = middle
    return short
