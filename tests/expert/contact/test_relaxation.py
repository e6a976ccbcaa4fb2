"""Bounds over boxes against sampled plans, and boxes without any plan."""

import itertools

import numpy as np
import pytest

from expert.contact.box import Box
from expert.contact.plan_at import forces_at
from expert.contact.ranges import narrow
from expert.contact.relaxation import Goal, relax
from expert.contact.scaled import ScaledTask
from expert.contact.sequence import sequence_of
from tests.support.random_tasks import floor_task, table_task


def boxes(seed: int) -> list[tuple[ScaledTask, Box]]:
    """Boxes of all pairs of facets that are pressed all the time, where there are any."""
    rng = np.random.default_rng(seed)
    scaled = ScaledTask.of(floor_task(rng) if seed % 2 else table_task(rng))
    found = []
    for on in itertools.combinations(range(scaled.facets), 2):
        s = sequence_of(scaled, np.tile(on, (scaled.steps, 1)))
        lo, hi = s.lo.copy(), s.hi.copy()
        if narrow(scaled, s, lo, hi)[0]:
            found.append((scaled, Box(s, lo, hi, np.full_like(s.modes, -1))))
    return found


@pytest.mark.parametrize("seed", range(6))
def test_no_plan_in_a_box_costs_less_than_its_bound(seed: int) -> None:
    rng, compared = np.random.default_rng(seed), 0
    for scaled, box in boxes(seed):
        found = relax(scaled, box, Goal(np.inf, 1e-3, 25))
        assert found.forces <= found.bound + 1e-9 * (1 + abs(found.bound)) or found.bound == -np.inf
        for _ in range(20):
            cost = forces_at(scaled, box.sequence, rng.uniform(box.lo, box.hi)).cost
            if np.isfinite(cost):
                compared += 1
                assert cost >= found.bound - 1e-9 * (1 + abs(cost))
        if np.isfinite(found.cost):
            again = forces_at(scaled, box.sequence, found.z).cost
            assert again == pytest.approx(found.cost, rel=1e-9)
            assert found.cost >= found.bound - 1e-9 * (1 + abs(found.cost))
    assert compared > 0


def test_a_small_box_is_bounded_to_second_order() -> None:
    """A tenth of the width, a hundredth of the gap, or nothing but rounding."""
    compared = 0
    for scaled, box in boxes(1):
        middle, gaps = 0.5 * (box.lo + box.hi), []
        if not np.isfinite(forces_at(scaled, box.sequence, middle).cost):
            continue
        for share in (1.0, 0.1):
            half = 0.5 * share * (box.hi - box.lo)
            found = relax(scaled, box._replace(lo=middle - half, hi=middle + half), Goal(np.inf, 1e-9, 25))
            gaps.append(found.cost - found.bound)
        compared += 1
        assert gaps[1] <= 0.03 * gaps[0] + 1e-6
    assert compared > 0


def test_a_box_between_hopeless_places_is_proved_empty() -> None:
    """Cut the box down to where the narrowing said that nothing balances."""
    proved = 0
    for seed in range(1, 12, 2):
        scaled = ScaledTask.of(floor_task(np.random.default_rng(seed)))
        for on in itertools.combinations(range(scaled.facets), 2):
            s = sequence_of(scaled, np.tile(on, (scaled.steps, 1)))
            lo, hi = s.lo.copy(), s.hi.copy()
            if (lo > hi).any() or not narrow(scaled, s, lo, hi)[0]:
                continue
            for k in np.flatnonzero(lo > s.lo + 0.01):
                below = hi.copy()
                below[k] = lo[k] - 1e-3
                start = lo.copy()
                start[k] = s.lo[k]
                found = relax(scaled, Box(s, start, below, np.full_like(s.modes, -1)), Goal(np.inf, 1e-3, 25))
                assert found.bound == np.inf
                proved += 1
    assert proved > 0
