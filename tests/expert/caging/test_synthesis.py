"""Search for cages: what is found is verified here again, what is asked for is kept, and not found is not impossible."""

import numpy as np
import pytest

from expert.caging.immobilise import candidates
from expert.caging.synthesis import solve
from expert.errors import InvalidProblem
from expert.geometry.polygon import signed_distance
from expert.geometry.pose import Array
from expert.problems.cage import CageProblem, CageSolution
from expert.verify.cage.check import verify, verify_cage
from expert.world.fingers import Gripper
from expert.world.named import named_shape
from expert.world.shape import Shape
from tests.support.polygons import random_polygon


def problem(vertices: Array, count: int, **changes: object) -> CageProblem:
    return CageProblem(shape=Shape(vertices=vertices), pose=np.zeros(3), count=count, **changes)  # type: ignore[arg-type]


@pytest.mark.parametrize("count", [3, 4, 5])
def test_random_polygons_are_caged_and_verified(count: int) -> None:
    for seed in range(4):
        task = problem(random_polygon(np.random.default_rng(seed), 4 + 2 * seed), count)
        answer = solve(task, time_limit=30)
        assert answer.found
        assert answer.fingers.shape == (count, 2)
        assert verify(task, answer).verdict == "caged"


@pytest.mark.parametrize("name", ["T", "M", "hourglass"])
def test_the_model_alone_cages_named_shapes_with_a_loop_that_it_names(name: str) -> None:
    task = problem(named_shape(name), 3, rotation=(tuple(np.radians([20, 20])),))
    answer = solve(task, time_limit=60, method="model")
    assert answer.found
    assert answer.refuted == 0
    assert [meeting.element for meeting in answer.topology] == [0, 1, 2]
    assert verify(task, answer).verdict == "caged"


def test_two_fingers_find_the_waist() -> None:
    task = problem(named_shape("hourglass"), 2)
    answer = solve(task, time_limit=30)
    assert answer.found
    assert verify(task, answer).verdict == "caged"


def test_a_pose_anywhere_gives_fingers_there() -> None:
    vertices, pose = named_shape("M"), np.array([0.4, -0.3, 2.0])
    answer = solve(CageProblem(shape=Shape(vertices=vertices), pose=pose, count=3), time_limit=60)
    assert answer.found
    assert np.linalg.norm(answer.fingers - pose[:2], axis=1).max() < 0.2


def test_no_two_fingers_cage_a_triangle_and_that_is_not_called_impossible() -> None:
    triangle = np.array([[0, 0], [0.1, 0], [0.03, 0.08]])
    answer = solve(problem(triangle, 2), time_limit=30)
    assert answer.status == "none_found"
    assert "others may exist" in answer.reason


def test_a_spent_time_limit_is_reported_as_such() -> None:
    answer = solve(problem(named_shape("hooks"), 4), time_limit=1e-9)
    assert answer.status == "time_limit"
    assert not answer.found


def test_given_fingers_are_refused() -> None:
    task = problem(named_shape("I"), 2).arrangement(np.array([[-0.02, 0], [0.02, 0]]))
    with pytest.raises(InvalidProblem, match=r"fingers\.count"):
        solve(task)


@pytest.mark.slow
def test_costs_order_two_finger_cages() -> None:
    spans = {}
    for cost in ("min_separation", "max_opening"):
        task = problem(named_shape("hourglass"), 2, cost=cost, rotation=(tuple(np.radians([30, 30])),))
        answer = solve(task, time_limit=6)
        assert answer.found
        spans[cost] = float(np.linalg.norm(answer.fingers[1] - answer.fingers[0]))
    assert spans["min_separation"] < 0.8 * spans["max_opening"]


def test_immobilising_grasps_are_outside_and_mostly_cage() -> None:
    caged = 0
    for seed in range(10):
        shape = Shape(vertices=random_polygon(np.random.default_rng(seed), 7))
        for fingers in candidates(shape.vertices, 3, shape.size, np.random.default_rng(0)):
            assert (signed_distance(shape.vertices, fingers) > 0).all()
            arrangement = problem(shape.vertices, 3).arrangement(fingers)
            if verify_cage(arrangement).verdict == "caged":
                caged += 1
                break
    assert caged >= 8


def test_an_answer_that_its_grippers_cannot_hold_is_refuted() -> None:
    task = problem(named_shape("I"), 2, grippers=(Gripper(fingers=(0, 1), opening=(0.0, 0.03)),))
    answer = CageSolution(status="caged", fingers=np.array([[-0.02, 0.0], [0.02, 0.0]]))
    report = verify(task, answer)
    assert report.verdict == "refuted"
    assert "gripper 0 opens by 0.04 m" in str(report)


@pytest.mark.parametrize(("name", "count"), [("hourglass", 3), ("T", 3)])
def test_scip_finds_cages_too(name: str, count: int) -> None:
    task = problem(named_shape(name), count, rotation=(tuple(np.radians([20, 20])),))
    answer = solve(task, time_limit=120, method="model", solver="scip")
    assert answer.found
    assert answer.refuted == 0
    assert verify(task, answer).verdict == "caged"


def test_the_fewest_fingers_are_used_and_what_fewer_gave_is_said() -> None:
    waist = problem(named_shape("hourglass"), 4, fewest=True)
    answer = solve(waist, time_limit=60)
    assert answer.fingers.shape == (2, 2)
    assert answer.reason == "2 fingers: caged"
    triangle = np.array([[0, 0], [0.1, 0], [0.03, 0.08]])
    answer = solve(problem(triangle, 4, fewest=True), time_limit=60)
    assert answer.fingers.shape == (3, 2)
    assert answer.reason in (
        "2 fingers: no cage of the kind searched for; 3 fingers: caged",
        "2 fingers: undecided in their share of the time; 3 fingers: caged",
    )
    assert verify(problem(triangle, 4, fewest=True), answer).verdict == "caged"


def test_fewest_adds_up_what_happened_and_ends_in_time() -> None:
    triangle = np.array([[0, 0], [0.1, 0], [0.03, 0.08]])
    answer = solve(problem(triangle, 3, fewest=True), time_limit=1e-9)
    assert answer.status == "time_limit"
    assert answer.reason.count("undecided") == 2
    answer = solve(problem(triangle, 2, fewest=True), time_limit=30)
    assert answer.status == "none_found"
    assert answer.attempts > 0


def test_fixed_fingers_count_towards_the_fewest() -> None:
    """Two fixed fingers hold the waist of the hourglass: no searched finger is needed."""
    vertices = named_shape("hourglass")
    held = solve(problem(vertices, 2), time_limit=60).fingers
    answer = solve(problem(vertices, 2, fewest=True, fixed=held), time_limit=60)
    assert answer.found
    assert answer.fingers.shape == (0, 2)
