"""Executions from verified starts, and the comparison with contacts chosen for their quality."""

import numpy as np
import pytest

from expert.errors import InvalidProblem
from expert.grasping.executions import executions, force_closure_comparison, pose_errors, start_set
from expert.problems.grasp import GraspProblem, GraspSolution
from expert.world.shape import Shape

CORNERS = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
TASK = GraspProblem(shape=Shape(vertices=0.05 * CORNERS), pose=np.array([0.02, 0.0, 0.0]))
CONTACTS = np.array([[0.015, -0.05], [0.05, -0.015], [-0.015, 0.05], [-0.05, 0.015]]) + TASK.pose[:2]
OUTWARD = np.array([[0, -1], [1, 0], [0, 1], [-1, 0]])
ANSWER = GraspSolution(
    status="uncertified",
    path=np.stack([CONTACTS + d * OUTWARD for d in (0.008, 0.006, 0.004, 0.002, 0.0)]),
)


def test_executions_are_the_same_each_time() -> None:
    np.testing.assert_array_equal(executions(TASK, ANSWER, 5).poses, executions(TASK, ANSWER, 5).poses)


def test_there_are_no_starts_without_a_cage() -> None:
    far = GraspSolution(status="uncertified", path=ANSWER.path + 3 * (ANSWER.path - TASK.pose[:2]))
    with pytest.raises(InvalidProblem, match="cage the goal"):
        executions(TASK, far, 5)


def test_the_start_area_is_that_of_the_slice() -> None:
    """At the goal's orientation four fingers, 8 mm away from a square's sides, leave it a square of 16 mm."""
    assert start_set(TASK, ANSWER).area == pytest.approx(0.016**2, rel=1e-6)


def test_pose_errors_add_up_over_the_size() -> None:
    ends = TASK.pose + np.array([[0.01, 0, 0], [0, -0.02, 0], [0, 0, 0.3]])
    gyration = 0.1 / np.sqrt(6)
    np.testing.assert_allclose(pose_errors(TASK, ends) * TASK.shape.size, [0.01, 0.02, 0.3 * gyration])


def test_the_comparison_starts_both_strategies_at_the_same_poses() -> None:
    starts, errors, ends = force_closure_comparison(TASK, ANSWER, 20)
    assert starts.shape == (20, 3)
    assert set(errors) == set(ends) == {"force closure", "certified"}
    for name, (poses, _) in ends.items():
        np.testing.assert_allclose(errors[name], pose_errors(TASK, poses))
    assert errors["certified"].max() < 1e-9
