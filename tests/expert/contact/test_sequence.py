"""Variables of a mode sequence: intervals, positions on facets, and the smoothing cost against differences of positions."""

import numpy as np
import pytest

from expert.contact.scaled import ScaledTask
from expert.contact.sequence import accelerations, pushes, sequence_of, smoothing
from expert.problems.contact import FREE
from tests.support.random_tasks import floor_task

MODES = np.array([[0, FREE], [0, 2], [FREE, 2], [1, FREE], [1, 2]])


@pytest.fixture
def scaled() -> ScaledTask:
    return ScaledTask.of(floor_task(np.random.default_rng(1), steps=5))


def test_intervals_are_counted_finger_by_finger(scaled: ScaledTask) -> None:
    s = sequence_of(scaled, MODES)
    np.testing.assert_array_equal(s.interval.T, [[0, 0, FREE, 1, 1], [FREE, 2, 2, FREE, 3]])
    np.testing.assert_array_equal(s.facet, [0, 1, 2, 2])
    assert s.size == 4 + 2 * 3


def test_who_goes_on_may_push_and_everybody_at_the_end(scaled: ScaledTask) -> None:
    s = sequence_of(scaled, MODES)
    assert [pushes(s, t).tolist() for t in range(5)] == [[0], [2], [], [1], [1, 3]]


def test_the_smoothing_cost_is_that_of_second_differences(scaled: ScaledTask) -> None:
    s, rng = sequence_of(scaled, MODES), np.random.default_rng(0)
    for _ in range(5):
        z = rng.uniform(0, 1, s.size)
        p = s.offset + s.map @ z
        second = p[2:] - 2 * p[1:-1] + p[:-2]
        np.testing.assert_allclose(accelerations(s, z), second, atol=1e-12)
        assert smoothing(s, z) == pytest.approx(scaled.acceleration_weight * (second**2).sum())


def test_touching_fingers_lie_on_their_facets_at_one_place(scaled: ScaledTask) -> None:
    s = sequence_of(scaled, MODES)
    z = np.random.default_rng(0).uniform(0, 1, s.size)
    p = s.offset + s.map @ z
    for t, c in np.argwhere(MODES != FREE):
        f, rho = MODES[t, c], z[s.interval[t, c]]
        place = scaled.centre[t] + scaled.arm[t, f] + rho * scaled.edge[t, f]
        np.testing.assert_allclose(p[t, c], place, atol=1e-12)


def test_a_finger_that_never_touches_is_parked(scaled: ScaledTask) -> None:
    s = sequence_of(scaled, np.column_stack([MODES[:, 0], np.full(5, FREE)]))
    assert (s.free[:, 1] < 0).all()
    np.testing.assert_array_equal(s.offset[:, 1], np.tile(scaled.parking, (5, 1)))
