"""Rows and regions of a box against what they mean."""

import numpy as np
import pytest

from expert.contact.box import FAR, Box, least_over_box, nearest_region, standing_rows, worst_intrusion
from expert.contact.scaled import ScaledTask
from expert.contact.sequence import sequence_of
from expert.geometry.polygon import signed_distance
from expert.geometry.pose import to_body
from expert.problems.contact import FREE, ContactTask
from tests.support.random_tasks import floor_task

MODES = np.array([[3, FREE], [3, 2], [FREE, 2], [1, FREE]])


@pytest.fixture
def task() -> ContactTask:
    return floor_task(np.random.default_rng(1))


def test_rows_hold_just_where_fingers_may_be(task: ContactTask) -> None:
    scaled = ScaledTask.of(task)
    s = sequence_of(scaled, MODES)
    assigned = np.full(MODES.shape, -1)
    assigned[2, 0] = above = int(scaled.region[2, :, 0, 1].argmin())  # -y <= b: beyond the top
    box = Box(s, s.lo, s.hi, assigned)
    A, b = standing_rows(scaled, box, s.size)
    rng, kept = np.random.default_rng(0), 0
    for _ in range(400):
        z = np.concatenate([rng.uniform(-0.1, 1.1, len(s.lo)), rng.uniform(-1.5, 1.5, s.size - len(s.lo))])
        free = z[len(s.lo) :].reshape(-1, 2)
        fits = ((s.lo <= z[: len(s.lo)]) & (z[: len(s.lo)] <= s.hi)).all()
        fits &= (free @ scaled.walls[:, :2].T >= scaled.walls[:, 2]).all()
        region = scaled.region[2, above]
        fits &= (region[:, :2] @ z[s.free[2, 0] : s.free[2, 0] + 2] <= region[:, 2]).all()
        assert (A @ z >= b).all() == fits
        kept += fits
    assert 0 < kept < 400


def test_the_nearest_region_tells_inside_from_outside(task: ContactTask) -> None:
    scaled, rng = ScaledTask.of(task), np.random.default_rng(1)
    for t, pose in enumerate(task.trajectory.poses):
        for point in rng.uniform(-1, 1, (50, 2)) + scaled.centre[t]:
            region, miss = nearest_region(scaled, t, *point)
            world = scaled.origin + scaled.size * point
            distance = float(signed_distance(task.body.vertices, to_body(pose, world[None]))[0])
            assert (miss <= 0) == (distance >= task.robustness.free_clearance)
            rows = scaled.region[t, region]
            assert miss == pytest.approx((rows[:, :2] @ point - rows[:, 2]).max())


def test_the_deepest_finger_is_found(task: ContactTask) -> None:
    scaled = ScaledTask.of(task)
    s = sequence_of(scaled, MODES)
    box = Box(s, s.lo, s.hi, np.full(MODES.shape, -1))
    z = s.reference.copy()
    assert worst_intrusion(scaled, box, z)[2] == 0.0
    v = s.free[2, 0]
    z[v : v + 2] = scaled.centre[2]
    t, c, depth = worst_intrusion(scaled, box, z)
    assert (t, c) == (2, 0)
    assert depth > 0.05


def test_a_linear_function_falls_no_further_than_said() -> None:
    scaled = ScaledTask.of(floor_task(np.random.default_rng(1)))
    s, rng = sequence_of(scaled, MODES), np.random.default_rng(2)
    z, slope = s.reference, rng.normal(size=s.size)
    least = least_over_box(scaled, s.lo, s.hi, z, slope)
    low = np.concatenate([s.lo, np.tile(scaled.workspace[0] - FAR, (s.size - len(s.lo)) // 2)])
    high = np.concatenate([s.hi, np.tile(scaled.workspace[1] + FAR, (s.size - len(s.lo)) // 2)])
    corners = [slope @ (rng.choice([0, 1], s.size) * (high - low) + low - z) for _ in range(200)]
    assert least <= min(corners)
    assert least == pytest.approx(slope @ (np.where(slope > 0, low, high) - z))
