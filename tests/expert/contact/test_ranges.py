"""Ranges of rho from which steps can be balanced: against a scan, and every piece cut off with its proof."""

import numpy as np

from expert.contact.ranges import ALL, HIGH, LOW, narrow, no_pieces, tighten
from expert.contact.scaled import ScaledTask
from expert.contact.sequence import sequence_of
from expert.contact.steps import Stance, shortfall, solve_step
from expert.numeric.qp import INFEASIBLE
from tests.support.random_tasks import floor_task

PAIRS = ([0, 2], [1, 3], [1, 2])


def stance_of(on: list[int], t: int, low: float = 0.05, high: float = 0.95) -> Stance:
    return Stance(t, np.array(on), np.array([low, 0.05]), np.array([high, 0.95]))


def test_tightened_ranges_agree_with_a_scan() -> None:
    moved = hopeless = 0
    for seed in range(12):
        scaled = ScaledTask.of(floor_task(np.random.default_rng(seed)))
        for on in PAIRS:
            stance, t = stance_of(on, seed % 4), seed % 4
            pieces = no_pieces(20)
            kept = tighten(scaled, stance, 0, LOW, pieces) and tighten(scaled, stance, 0, HIGH, pieces)
            grid = np.linspace(0.05, 0.95, 181)
            possible = [r for r in grid if solve_step(scaled, stance_of(on, t, r, r)).status != INFEASIBLE]
            if not possible:
                hopeless += 1
                assert not kept or solve_step(scaled, stance_of(on, t)).status != INFEASIBLE
                continue
            low, high = stance.lo[0], stance.hi[0]
            moved += low > 0.05 or high < 0.95
            assert kept
            assert possible[0] - 0.006 <= low <= possible[0] + 1e-9
            assert possible[-1] - 1e-9 <= high <= possible[-1] + 0.006
    assert moved >= 3
    assert hopeless >= 3


def test_every_piece_cut_off_is_proved_hopeless_over_all_of_it() -> None:
    proved = 0
    for seed in range(12):
        scaled = ScaledTask.of(floor_task(np.random.default_rng(seed)))
        for on in PAIRS:
            sequence = sequence_of(scaled, np.tile(on, (scaled.steps, 1)))
            if (sequence.lo > sequence.hi).any():
                continue
            lo, hi = sequence.lo.copy(), sequence.hi.copy()
            kept, pieces = narrow(scaled, sequence, lo, hi)
            low, high = sequence.lo.copy(), sequence.hi.copy()
            for i in range(pieces.filled[0]):
                k, part, at = pieces.interval[i], pieces.part[i], pieces.at[i]
                ends = (low.copy(), high.copy())
                if part != ALL:
                    ends[1 - part][k] = at
                    (low, high)[part][k] = at
                stance = Stance(pieces.step[i], sequence.facet, *ends)
                assert shortfall(scaled, stance, pieces.y[i]) > 0
                proved += 1
            if kept:
                np.testing.assert_array_equal(low, lo)
                np.testing.assert_array_equal(high, hi)
            else:
                assert pieces.part[pieces.filled[0] - 1] == ALL
    assert proved >= 10
