"""Contact modes over time as an automaton, and the least cost-to-go over it (Thesis 3-CT5).

State of a finger: 0 free, or 1 + 3 f + a on facet f for the first (a = 0), second (1), or a later step (2).  A finger leaves
a facet before it takes another one.  Within an interval rho is constant; force may act at t only if the finger stays
until t + 1 (or t is the last step): the last step of an interval is its force-free release.  Dynamic programming
over joint states gives bounds.
"""

import itertools
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from expert.contact.scaled import ScaledTask
from expert.contact.steps import Stance, solve_step
from expert.errors import InvalidProblem
from expert.geometry.pose import Array
from expert.numeric.qp import INFEASIBLE, compiled
from expert.world.values import IntArray

MOST_STATES = 60_000
"""Joint states of all fingers that the automaton may have."""


class Moves(NamedTuple):
    """Joint states of C fingers, numbered in base 1 + 3 F, and what may follow each: compressed rows.

    states (N, C); follow[start[s] : start[s + 1]] are the successors of s, active the index into the step costs of
    the fingers that push on the way.
    """

    states: IntArray
    start: IntArray
    follow: IntArray
    active: IntArray


@lru_cache(maxsize=64)
def moves_of(facets: int, fingers: int, min_interval: int) -> Moves:
    """All moves of the automaton; they depend on no geometry."""
    single = _successors(facets, min_interval)
    base = 1 + 3 * facets
    if base**fingers > MOST_STATES:
        raise InvalidProblem(
            "fingers.count",
            expected=f"at most {int(np.log(MOST_STATES) / np.log(base))} for {facets} facets",
            got=str(fingers),
            remedy="use fewer fingers or a simpler outline",
        )
    states = np.array(list(itertools.product(range(base), repeat=fingers)))
    place, digit = base ** np.arange(fingers)[::-1], (facets + 1) ** np.arange(fingers)[::-1]
    follow, active = [], []
    for joint in states:
        after = np.array(list(itertools.product(*(single[s] for s in joint))))
        follow.append(after @ place)
        active.append(np.where(after > 0, (joint + 2) // 3, 0) @ digit)
    start = np.concatenate([[0], np.cumsum([len(f) for f in follow])])
    return Moves(states, start, np.concatenate(follow), np.concatenate(active))


def _successors(facets: int, min_interval: int) -> list[list[int]]:
    takes = [1 + 3 * f for f in range(facets)]
    follow = [[0, *takes]]
    for first in takes:
        leave = [] if min_interval > 1 else [0]
        follow += [[*leave, first + 1], [0, first + 2], [0, first + 2]]
    return follow


class StepCosts(NamedTuple):
    """Lower bounds of force costs by step and set of active facets, and their proofs.

    cost (T, (F + 1)^C), inf: proved impossible; sets in base F + 1, one digit per finger, 1 + facet or 0.  y (T, M, 3):
    multipliers of the M multisets in lexicographic order, fingers being interchangeable.
    """

    cost: Array
    y: Array


def step_costs(scaled: ScaledTask, fingers: int) -> StepCosts:
    """Least force cost of every active set at every step."""
    base = scaled.facets + 1
    sets = np.array(list(itertools.combinations_with_replacement(range(base), fingers)))
    digits = np.array(list(itertools.product(range(base), repeat=fingers)))
    place = base ** np.arange(fingers)[::-1]
    column = np.empty(base**fingers, dtype=np.int64)
    column[sets @ place] = np.arange(len(sets))
    costs, y = _set_costs(scaled, sets)
    return StepCosts(costs[:, column[np.sort(digits, axis=1) @ place]], y)


@compiled
def _set_costs(scaled: ScaledTask, sets: IntArray) -> tuple[Array, Array]:
    T, M = len(scaled.required), len(sets)
    costs, y = np.full((T, M), np.inf), np.zeros((T, M, 3))
    for k in range(M):
        facets = sets[k][sets[k] > 0] - 1
        for t in range(T):
            stance = Stance(t, facets, scaled.low[t][facets], scaled.high[t][facets])
            if (stance.lo <= stance.hi).all():
                found = solve_step(scaled, stance)
                y[t, k] = found.y
                if found.status != INFEASIBLE:
                    costs[t, k] = found.bound
    return costs, y


def window_costs(scaled: ScaledTask) -> Array:
    """Least smoothing cost at t of a finger that sat on f since t - 2, (T, 1 + 3 F) by state; inf: rho has no room."""
    T = scaled.steps
    cost = np.zeros((T, 1 + 3 * scaled.facets))
    impossible = scaled.low > scaled.high
    for age in range(3):
        cost[:, 1 + age :: 3][impossible] = np.inf
    start = scaled.centre[:, None] + scaled.arm
    for t in range(2, T):
        p0, p1 = (x[t] - 2 * x[t - 1] + x[t - 2] for x in (start, scaled.edge))
        lo, hi = scaled.low[t - 2 : t + 1].max(axis=0), scaled.high[t - 2 : t + 1].min(axis=0)
        curvature = np.maximum((p1 * p1).sum(axis=1), 1e-300)
        rho = np.clip(-(p0 * p1).sum(axis=1) / curvature, lo, np.maximum(lo, hi))
        value = scaled.acceleration_weight * ((p0 + rho[:, None] * p1) ** 2).sum(axis=1)
        cost[t, 3::3] = np.where(lo <= hi, value, np.inf)
    return cost


def last_costs(scaled: ScaledTask, phi: Array, moves: Moves) -> Array:
    """Force cost of the last step by joint state, (N,): every finger in contact may push."""
    digit = (scaled.facets + 1) ** np.arange(moves.states.shape[1])[::-1]
    cost = phi[-1, ((moves.states + 2) // 3) @ digit]
    if scaled.min_interval > 1:
        just_arrived = ((moves.states > 0) & (moves.states % 3 == 1)).any(axis=1)
        cost = np.where(just_arrived, np.inf, cost)
    return cost


@compiled
def cost_to_go(phi: Array, windows: Array, moves: Moves, last: Array) -> Array:
    """V[t, s]: least force cost from t on plus smoothing cost after t, over all mode sequences from joint state s."""
    T, N, C = len(phi), moves.states.shape[0], moves.states.shape[1]
    V = np.full((T, N), np.inf)
    V[T - 1] = last
    arriving = np.empty(N)
    for t in range(T - 2, -1, -1):
        for s in range(N):
            arriving[s] = V[t + 1, s]
            for c in range(C):
                arriving[s] += windows[t + 1, moves.states[s, c]]
        for s in range(N):
            for k in range(moves.start[s], moves.start[s + 1]):
                cost = phi[t, moves.active[k]] + arriving[moves.follow[k]]
                V[t, s] = min(V[t, s], cost)
    return V
