"""The search for a certified grasp, its options and its answer."""

from typing import Any

import numpy as np
import pytest

from expert.errors import InvalidProblem
from expert.problems.grasp import GraspOptions, GraspProblem, GraspSolution, arrangement_at, schedule
from expert.world.fingers import Gripper
from expert.world.shape import Shape

SQUARE = Shape(vertices=np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]))


def problem(**changes: Any) -> GraspProblem:
    return GraspProblem(shape=SQUARE, pose=np.zeros(3), **changes)


def test_the_usual_schedule_falls_to_a_quarter_and_then_to_half_a_degree() -> None:
    np.testing.assert_allclose(schedule(40), [40, 30, 20, 10, 0.5])
    np.testing.assert_allclose(np.degrees(problem().half_ranges), schedule())


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"count": 5}, "fingers.count"),
        ({"half_ranges": [0.1]}, "options.half_ranges"),
        ({"half_ranges": [0.1, 0.2]}, "options.half_ranges"),
        ({"half_ranges": [1.6, 0.2]}, "options.half_ranges"),
        ({"margin": 0.1}, "options.margin"),
        ({"cost": "beauty"}, "cost"),
        ({"count": 3, "grippers": (Gripper(fingers=(0, 3), opening=(0, 1)),)}, "fingers.grippers"),
    ],
)
def test_impossible_problems_are_refused(changes: dict[str, Any], complaint: str) -> None:
    with pytest.raises(InvalidProblem, match=f"^{complaint}: "):
        problem(**changes)
    with pytest.raises(InvalidProblem, match=r"^options\.time_limit: "):
        GraspOptions(time_limit=0)


def test_fingers_go_straight_from_knot_to_knot() -> None:
    far = np.array([[0, -3], [3, 0], [0, 3], [-3, 0.0]])
    answer = GraspSolution(status="certified", path=np.stack([far, far / 2, far / 2.5]))
    np.testing.assert_allclose(answer.fingers(0.5), 0.75 * far)
    np.testing.assert_allclose(answer.fingers(2), far / 2.5)
    np.testing.assert_allclose(arrangement_at(problem(), answer, 1.0).fingers, far / 2)
    assert answer.found
    assert not GraspSolution(status="uncertified").found
