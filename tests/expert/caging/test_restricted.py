"""Cages with walls, fixed fingers, grippers and costs: what is asked for is kept, and the checker recomputes it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely

from expert.caging.closures import Closures, directions
from expert.caging.polish import improvements
from expert.caging.requirements import TRIPOD, objective
from expert.caging.synthesis import solve
from expert.errors import InvalidProblem
from expert.files import read_problem
from expert.geometry.polygon import signed_distance
from expert.geometry.pose import cross, rotation, to_world
from expert.problems.cage import CageProblem, CageSolution
from expert.verify.cage.check import verify, verify_cage
from expert.verify.cage.claims import unmet_claim
from expert.world.fingers import Gripper
from expert.world.named import named_shape
from expert.world.shape import Shape

PROBLEMS = Path("configs/problem/cage")
RESTRICTED = [f"{shape}_{kind}" for shape in ("t", "i", "m", "hourglass") for kind in ("wall", "grippers")]
PAIRS = (Gripper(fingers=(0, 1), opening=(0.0, 0.11)), Gripper(fingers=(2, 3), opening=(0.0, 0.11)))


def problem(name: str, count: int, pose: object = (0.0, 0.0, 0.0), **changes: object) -> CageProblem:
    return CageProblem(shape=Shape(vertices=named_shape(name)), pose=np.array(pose), count=count, **changes)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", [*RESTRICTED, "t_fixed"])
def test_walls_grippers_and_fixed_fingers_are_solved_and_verified_from_files(name: str) -> None:
    task = read_problem(PROBLEMS / f"{name}.yaml").task
    assert isinstance(task, CageProblem)
    answer = solve(task, time_limit=60)
    assert answer.found
    assert verify(task, answer).verdict == "caged"


def test_the_wall_is_needed() -> None:
    task = read_problem(PROBLEMS / "t_wall.yaml").task
    assert isinstance(task, CageProblem)
    answer = solve(task, time_limit=60)
    free = replace(task, walls=())
    assert verify(free, answer).verdict == "escapes"


@pytest.mark.parametrize("angle", [0.0, 0.7, -1.2])
def test_parallel_grippers_open_along_one_common_direction_which_turns_with_everything(angle: float) -> None:
    task = problem("T", 4, pose=[0.1, 0.2, angle], grippers=PAIRS, parallel=True)
    answer = solve(task, time_limit=60)
    assert answer.found
    steps = answer.fingers[[1, 3]] - answer.fingers[[0, 2]]
    assert cross(*(steps / np.linalg.norm(steps, axis=1, keepdims=True))) == pytest.approx(0, abs=1e-4)
    assert np.linalg.norm(steps, axis=1).max() <= 0.11 + 1e-6


def test_a_stated_direction_is_kept() -> None:
    turn = np.radians(30)
    task = problem("I", 4, pose=[0, 0, turn], grippers=PAIRS, parallel=True, direction=turn)
    answer = solve(task, time_limit=60)
    assert answer.found
    steps = (answer.fingers[[1, 3]] - answer.fingers[[0, 2]]) @ rotation(turn)
    assert steps[:, 1] == pytest.approx(0, abs=1e-6)
    assert (steps[:, 0] > 0).all()
    other = replace(task, direction=turn + 0.01)
    assert "not parallel to the stated direction" in verify(other, answer).reason


def test_a_direction_without_parallel_grippers_is_refused() -> None:
    with pytest.raises(InvalidProblem, match=r"fingers\.direction"):
        problem("I", 4, grippers=PAIRS, direction=0.0)


def test_directions_are_tried_once_each_and_x_first() -> None:
    task = problem("M", 4, grippers=PAIRS, parallel=True)
    angles = np.array(directions(task))
    assert angles[0] == 0
    apart = np.abs(np.sin(angles[:, None] - angles[None])) + np.eye(len(angles))
    assert np.degrees(np.arcsin(apart.min())) > 3


def test_a_fixed_finger_that_helps_does_and_one_that_does_not_is_left_aside() -> None:
    """Two fingers alone are not found to cage this T from below; with a third one over it they do.  Far away it is no help."""
    corners = np.array([[-0.0206, 0.0069], [0.0206, 0.0069]])
    helped = problem("T", 2, fixed=np.array([[0.0, 0.05]]))
    assert verify_cage(helped.arrangement(corners)).verdict == "caged"
    assert verify_cage(problem("T", 2).arrangement(corners)).verdict == "escapes"
    answer = solve(helped, time_limit=60)
    assert answer.found
    assert answer.fingers.shape == (2, 2)
    far = problem("hourglass", 2, fixed=np.array([[0.6, 0.6]]))
    answer = solve(far, time_limit=60)
    assert answer.found
    alone = problem("hourglass", 2)
    assert verify_cage(alone.arrangement(answer.fingers)).verdict == "caged"


def test_closures_are_outside_the_object_and_on_its_side_of_the_wall() -> None:
    task = read_problem(PROBLEMS / "t_wall.yaml").task
    assert isinstance(task, CageProblem)
    world = to_world(task.pose, task.shape.vertices)
    outline = shapely.Polygon(world).exterior
    wall = shapely.LineString(task.walls[0].ends)
    found = list(Closures(task).candidates(np.random.default_rng(0)))
    assert found
    for fingers in found:
        placed = to_world(task.pose, fingers)
        assert (signed_distance(world, placed) > 0).all()
        for x in placed:
            assert not shapely.shortest_line(shapely.Point(x), outline).intersects(wall)


@pytest.mark.parametrize(("name", "count", "cost"), [("M", 3, "max_opening"), ("T", 3, "min_separation")])
def test_improvements_cost_less_and_stay_what_they_are(name: str, count: int, cost: str) -> None:
    task = problem(name, count, cost=cost)
    fingers = np.array([0.0, 0.03]) + 0.04 * TRIPOD
    steps = list(improvements(task, fingers, 0.005, np.random.default_rng(0)))
    assert len(steps) > 3
    for moved in steps:
        assert objective(task, moved) < objective(task, fingers)
        assert np.linalg.norm(moved - fingers, axis=1).max() == pytest.approx(0.005)
        claim = CageSolution(status="caged", fingers=moved, objective=objective(task, moved))
        assert not unmet_claim(task, claim)


def test_a_tripod_opens_about_an_m_from_the_first_grasp_on() -> None:
    task = read_problem(PROBLEMS / "m_tripod.yaml").task
    assert isinstance(task, CageProblem)
    answer = solve(task, time_limit=5)
    assert answer.found
    assert verify(task, answer).verdict == "caged"
    grasps = (to_world(task.pose, x) for x in Closures(task).candidates(np.random.default_rng(0)))
    first = next(x for x in grasps if verify_cage(task.arrangement(x)).verdict == "caged")
    assert answer.objective <= objective(task, first)


def test_opening_and_separation_of_known_fingers() -> None:
    fingers = np.array([0.3, -0.1]) + 0.04 * TRIPOD
    tripod = problem("M", 3, cost="max_opening")
    assert objective(tripod, fingers) == pytest.approx(-0.04)
    pair = np.array([[0.0, 0.0], [0.03, 0.04]])
    assert objective(problem("M", 2, cost="max_opening"), pair) == pytest.approx(-0.03)
    assert objective(problem("M", 2, cost="min_separation"), pair) == pytest.approx(0.0025)


@pytest.mark.parametrize(
    ("cost", "count", "change", "complaint"),
    [
        ("max_opening", 3, [0, 0], ""),
        ("max_opening", 3, [1e-4, 0], "off the one-parameter gripper"),
        ("min_separation", 3, [0, 0], ""),
        ("min_separation", 3, [1e-3, 0], "the cost is"),
    ],
)
def test_the_checker_recomputes_costs(cost: str, count: int, change: list[float], complaint: str) -> None:
    task = problem("M", count, cost=cost)
    fingers = np.array([0.0, 0.034]) + 0.0302 * TRIPOD
    stated = objective(task, fingers)
    answer = CageSolution(status="caged", fingers=fingers + [change, [0, 0], [0, 0]], objective=stated)
    reason = verify(task, answer).reason
    assert complaint in reason
    assert bool(reason) == bool(complaint)


def test_a_wrong_stated_cost_is_refuted() -> None:
    task = problem("hourglass", 2, cost="min_separation")
    answer = CageSolution(status="caged", fingers=np.array([[-0.003, 0], [0.003, 0]]), objective=1e-5)
    report = verify(task, answer)
    assert report.verdict == "refuted"
    assert "the cost is 3.6e-05, not 1e-05" in str(report)
    assert verify(task, replace(answer, objective=3.6e-5)).verdict == "caged"
