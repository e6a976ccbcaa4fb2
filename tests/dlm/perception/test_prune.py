from dataclasses import replace

import numpy as np

from dlm.perception.fit import (
    quadratic,
)
from dlm.perception.prune import prune, straightness, without_tangles
from tests.support.moving_polygon import PENTAGON, TRUTH, observed


def test_needless_corners_go_and_needed_ones_stay() -> None:
    middles = (PENTAGON + np.roll(PENTAGON, -1, axis=0)) / 2
    doubled = np.stack([PENTAGON, middles], axis=1).reshape(-1, 2)
    found, _ = prune(replace(TRUTH, vertices=doubled), observed(TRUTH))
    assert len(found.vertices) == 5
    assert np.abs(found.vertices - PENTAGON).max() < 0.1


def test_straight_corners_cost_nothing_and_sharp_ones_much() -> None:
    with_middle = np.insert(PENTAGON, 1, [9.0, 6.0], axis=0)
    scene = replace(TRUTH, vertices=with_middle)
    rise = straightness(scene, quadratic(scene, observed(TRUTH)))
    assert rise.argmin() == 1
    assert rise[1] < 1e-9
    assert straightness(TRUTH, quadratic(TRUTH, observed(TRUTH))).min() > 100


def test_tangles_are_cut_off() -> None:
    loop = np.insert(PENTAGON, 2, [[18.0, 12.0], [18.0, 9.0], [15.0, 9.2]], axis=0)
    assert len(without_tangles(loop)) < len(loop)
    short = np.insert(PENTAGON, 1, [13.9, 6.0], axis=0)
    assert len(without_tangles(short)) == len(PENTAGON)
    assert np.array_equal(without_tangles(PENTAGON), PENTAGON)
