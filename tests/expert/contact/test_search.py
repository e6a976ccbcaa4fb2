"""The tree of all mode sequences: bounds that never overtake the optimum, and fingers that are interchangeable."""

import itertools

import numpy as np
import pytest

from expert.budget import Budget
from expert.contact.scaled import ScaledTask
from expert.contact.search import Search
from tests.support.random_tasks import floor_task, table_task


@pytest.mark.parametrize("seed", range(4))
def test_bounds_rise_to_the_optimum_with_the_budget(seed: int) -> None:
    rng = np.random.default_rng(seed)
    scaled = ScaledTask.of(floor_task(rng) if seed % 2 else table_task(rng))
    full = Search(scaled, 2, 1e-4).run(Budget(np.inf))
    outcomes = [Search(scaled, 2, 1e-4).run(Budget(np.inf), limit) for limit in (0, 3, 10, 30)]
    bounds = [outcome.bound for outcome in outcomes]
    assert all(a <= b + 1e-6 * abs(b) for a, b in itertools.pairwise([*bounds, full.bound]))
    assert full.bound <= full.best.cost
    assert all(outcome.best.cost >= full.bound for outcome in outcomes)


def test_only_sorted_sequences_are_planted() -> None:
    search = Search(ScaledTask.of(floor_task(np.random.default_rng(3))), 2, 1e-3)
    search.run(Budget(np.inf))
    assert search.planted
    for planted in search.planted:
        first, second = map(tuple, planted.sequence.modes.T.tolist())
        assert first <= second


def test_the_best_plan_s_sequence_was_planted_or_nothing_was_found() -> None:
    for seed in range(4):
        search = Search(ScaledTask.of(floor_task(np.random.default_rng(seed))), 2, 1e-3)
        best = search.run(Budget(np.inf)).best
        planted = [planted.sequence.modes for planted in search.planted]
        assert best.sequence is None or any((best.sequence.modes == modes).all() for modes in planted)
