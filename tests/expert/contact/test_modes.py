"""The automaton of contact modes and its dynamic program against enumeration."""

import itertools

import numpy as np
import pytest

from expert.contact.modes import cost_to_go, last_costs, moves_of, step_costs, window_costs
from expert.contact.scaled import ScaledTask
from expert.contact.sequence import sequence_of, smoothing
from expert.contact.steps import Stance, solve_step
from expert.problems.contact import Robustness
from tests.support.random_tasks import floor_task


def task(min_interval: int = 1) -> ScaledTask:
    options = Robustness(min_interval=min_interval)
    return ScaledTask.of(
        floor_task(np.random.default_rng(2), facets=3, steps=4, friction=1.0, robustness=options)
    )


def allowed(column: tuple[int, ...], min_interval: int) -> bool:
    """A facet is left before another is taken; contacts last."""
    jumps = any(a >= 0 and b >= 0 and a != b for a, b in itertools.pairwise(column))
    runs = [(f, len(list(g))) for f, g in itertools.groupby(column)]
    return not jumps and all(f < 0 or n >= min_interval for f, n in runs)


@pytest.mark.parametrize("min_interval", [1, 2])
def test_moves_make_all_allowed_sequences_and_no_others(min_interval: int) -> None:
    moves = moves_of(3, 1, min_interval)
    found: set[tuple[int, ...]] = set()

    def follow(state: int, column: tuple[int, ...]) -> None:
        facet = (int(moves.states[state, 0]) - 1) // 3 if moves.states[state, 0] else -1
        column = (*column, facet)
        if len(column) == 4:
            arrived = moves.states[state, 0] % 3 == 1
            if min_interval == 1 or not arrived:
                found.add(column)
            return
        for k in range(moves.start[state], moves.start[state + 1]):
            follow(int(moves.follow[k]), column)

    for state in range(len(moves.states)):
        if moves.states[state, 0] == 0 or moves.states[state, 0] % 3 == 1:
            follow(state, ())
    every = itertools.product(range(-1, 3), repeat=4)
    assert found == {column for column in every if allowed(column, min_interval)}


@pytest.mark.parametrize("min_interval", [1, 2])
def test_cost_to_go_is_the_least_over_all_sequences(min_interval: int) -> None:
    scaled = task(min_interval)
    moves, phi, windows = moves_of(3, 1, min_interval), step_costs(scaled, 1).cost, window_costs(scaled)
    to_go = cost_to_go(phi, windows, moves, last_costs(scaled, phi, moves))
    least = np.inf
    for column in itertools.product(range(-1, 3), repeat=4):
        if not allowed(column, min_interval):
            continue
        active = [column[t] + 1 if t == 3 or column[t] == column[t + 1] else 0 for t in range(4)]
        total = sum(phi[t, a] for t, a in enumerate(active))
        for t in range(2, 4):
            if column[t] >= 0 and len({*column[t - 2 : t + 1]}) == 1:
                total += windows[t, 3 + 3 * column[t]]
        least = min(least, total)
    starts = [s for s in range(len(moves.states)) if moves.states[s, 0] == 0 or moves.states[s, 0] % 3 == 1]
    assert to_go[0, starts].min() == pytest.approx(least)
    assert np.isfinite(least)


def test_sets_of_interchangeable_fingers_cost_the_same_and_as_much_as_their_step() -> None:
    scaled = task()
    costs = step_costs(scaled, 2)
    base = scaled.facets + 1
    for a, b in itertools.product(range(base), repeat=2):
        np.testing.assert_array_equal(costs.cost[:, base * a + b], costs.cost[:, base * b + a])
    on = np.array([0, 1])
    stance = Stance(1, on, scaled.low[1][on], scaled.high[1][on])
    assert (stance.lo <= stance.hi).all()
    assert costs.cost[1, base * 1 + 2] == solve_step(scaled, stance).bound


def test_windows_are_the_least_smoothing_cost_of_three_steps_on_a_facet() -> None:
    scaled = task()
    windows = window_costs(scaled)
    for f in range(3):
        s = sequence_of(scaled, np.full((3, 1), f))
        if (s.lo > s.hi).any():
            assert windows[2, 3 + 3 * f] == np.inf
            continue
        grid = [smoothing(s, np.array([rho])) for rho in np.linspace(s.lo[0], s.hi[0], 2001)]
        assert windows[2, 3 + 3 * f] == pytest.approx(min(grid), rel=1e-4, abs=1e-6)
        assert windows[2, 3 + 3 * f] <= min(grid) + 1e-9
