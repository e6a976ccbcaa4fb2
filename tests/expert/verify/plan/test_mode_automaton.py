"""Costs to go against enumeration of all mode sequences."""

import itertools

import numpy as np
import pytest

from expert.verify.plan.duality import Duality
from expert.verify.plan.mode_automaton import Automaton, mode, window_costs
from tests.support.random_tasks import floor_task


def sequences(moves: Automaton, steps: int) -> list[list[tuple[int, ...]]]:
    """All sequences of joint states."""
    found = [[s] for s in itertools.product(moves.follow[0], repeat=moves.fingers)]
    for _ in range(steps - 1):
        found = [
            [*s, after] for s in found for after in itertools.product(*(moves.follow[now] for now in s[-1]))
        ]
    return found


@pytest.mark.parametrize(("fingers", "min_interval"), [(1, 1), (2, 1), (2, 2)])
def test_costs_to_go_are_the_least_over_all_sequences(fingers: int, min_interval: int) -> None:
    rng, steps = np.random.default_rng(0), 4
    moves = Automaton(2, fingers, min_interval)
    costs = rng.uniform(0, 1, (steps, len(moves.sets)))
    windows = rng.uniform(0, 1, (steps, len(moves.follow)))
    to_go = moves.cost_to_go(costs, windows)
    least: dict[tuple[int, ...], float] = {}
    for s in sequences(moves, steps):
        last = moves.active_last(s[-1])
        if last is None:
            continue
        total = costs[-1, last] + sum(
            costs[t, moves.active(s[t], s[t + 1])] + windows[t + 1, list(s[t + 1])].sum()
            for t in range(steps - 1)
        )
        least[s[0]] = min(least.get(s[0], np.inf), total)
    assert len(least) == (3 if fingers == 1 else 9)
    for start, cost in least.items():
        assert to_go[(0, *start)] == pytest.approx(cost)


def test_a_finger_releases_before_it_takes_another_facet_and_pushes_where_it_stays() -> None:
    moves = Automaton(3, 1, 1)
    for states in sequences(moves, 4):
        facets = [mode(s[0]) for s in states]
        assert all(a in (b, -1) or b == -1 for a, b in itertools.pairwise(facets))
        for now, after in itertools.pairwise(states):
            held = mode(now[0]) if mode(now[0]) == mode(after[0]) else -1
            assert moves.sets[moves.active(now, after)] == (held + 1,)


def test_windows_are_what_sitting_on_a_facet_costs_at_least() -> None:
    bounds = Duality(floor_task(np.random.default_rng(1)))
    windows = window_costs(bounds)
    for t, f in itertools.product(range(2, bounds.steps), range(bounds.facets)):
        low, high = bounds.low[t - 2 : t + 1, f].max(), bounds.high[t - 2 : t + 1, f].min()
        if low > high:
            assert windows[t, 3 + 3 * f] == np.inf
            continue
        costs = []
        for rho in np.linspace(low, high, 2001):
            p = [bounds.place(s, f, rho) for s in (t - 2, t - 1, t)]
            costs.append(bounds.smooth_weight * ((p[2] - 2 * p[1] + p[0]) ** 2).sum())
        assert windows[t, 3 + 3 * f] == pytest.approx(min(costs), rel=1e-5, abs=1e-12)
