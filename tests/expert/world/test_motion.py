"""Motions: what goes on outside the horizon decides about the accelerations at its ends."""

import numpy as np
import pytest

from expert.errors import InvalidProblem
from expert.geometry.pose import Array
from expert.world.motion import Trajectory

T, DT = np.arange(6), 0.2


def motion(acceleration: Array) -> Array:
    return 0.5 * (DT * T[:, None]) ** 2 * acceleration + np.array([0.1, 0.2, 0.3])


def test_second_differences_of_a_constant_acceleration_are_that_acceleration() -> None:
    a = np.array([1.0, -2.0, 0.5])
    inside = Trajectory.of(motion(a), DT).accelerations[1:-1]
    np.testing.assert_allclose(inside, np.broadcast_to(a, inside.shape))


def test_steady_ends_go_on_and_resting_ends_stop() -> None:
    poses = np.column_stack([0.1 * T, np.zeros(6), 0 * T])
    np.testing.assert_allclose(Trajectory.of(poses, DT).accelerations, 0, atol=1e-12)
    stopped = Trajectory.of(poses, DT, "rest")
    speed = 0.1 / DT
    np.testing.assert_allclose(stopped.accelerations[:, 0] * DT, [speed, 0, 0, 0, 0, -speed], atol=1e-12)
    np.testing.assert_array_equal(stopped.extended[[0, -1]], poses[[0, -1]])


def test_stated_poses_outside_the_horizon_are_kept() -> None:
    path = Trajectory(dt=DT, poses=motion(np.ones(3)), before=np.full(3, -1.0), after=np.full(3, 9.0))
    np.testing.assert_array_equal(path.extended[0], [-1, -1, -1])
    np.testing.assert_array_equal(path.extended[-1], [9, 9, 9])
    assert not path.poses.flags.writeable


@pytest.mark.parametrize(
    ("poses", "dt", "ends", "field"),
    [
        (np.zeros((1, 3)), 0.1, "steady", "poses"),
        (np.zeros((3, 2)), 0.1, "steady", "poses"),
        (np.full((3, 3), np.nan), 0.1, "steady", "poses"),
        (np.zeros((3, 3)), 0.0, "steady", "dt"),
        (np.zeros((3, 3)), 0.1, "bounce", "ends"),
    ],
)
def test_what_is_no_motion_is_refused(poses: Array, dt: float, ends: str, field: str) -> None:
    with pytest.raises(InvalidProblem, match=f"^trajectory.{field}: "):
        Trajectory.of(poses, dt, ends)
