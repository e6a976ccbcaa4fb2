from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from expert.files import read_problem
from expert.problems.push import Finger, Tolerance
from expert.pushing.setting import Pushing
from expert.pushing.synthesis import solve
from expert.verify.push.check import verify
from tests.support.pushes import ELLIPSOID, TEE, square_problem

FOLDER = Path("configs/problem/push")
SMALL = {"depth": 5, "width": 60}


@pytest.mark.parametrize("seed", range(4))
def test_random_goals_are_reached_and_the_checker_agrees(seed):
    rng = np.random.default_rng(seed)
    goal = np.array([*rng.uniform(-0.15, 0.15, 2), rng.uniform(-3, 3)])
    finger = Finger(start=np.array([-0.15, -0.15]), radius=0.006, friction=float(rng.uniform(0, 0.5)))
    problem = square_problem(shape=TEE, goal=goal, finger=finger)
    plan = solve(problem, **SMALL)
    assert plan.status == "solved", plan.reason
    report = verify(problem, plan)
    assert report.verdict == "sound", str(report)
    end = np.array(report.ends[-1])
    assert np.abs(end[2] - plan.pushes[-1].pose[2]) < 0.01
    assert plan.objective > 0


def test_an_object_at_its_goal_stays_there():
    problem = square_problem(goal=np.array([2e-4, 0, 2 * np.pi]))
    plan = solve(problem)
    assert (plan.status, plan.pushes, plan.objective) == ("solved", (), 0.0)
    assert verify(problem, plan).verdict == "sound"


def test_the_tolerance_of_the_search_is_inside_both_of_the_problem():
    for position, angle in ((0.002, 0.035), (0.01, 0.001), (1e-4, 1.0)):
        pushing = Pushing(square_problem(tolerance=Tolerance(position=position, angle=angle)))
        goal, off = pushing.goal.pose, pushing.tolerance
        assert pushing.goal.error(goal + [off, 0, 0]) == pytest.approx(off)
        assert off < position
        assert pushing.goal.error(goal + [0, 0, angle]) > off


def test_a_goal_behind_a_slit_is_not_reached_and_the_reason_says_how_far_the_search_came():
    problem = read_problem(FOLDER / "slit.yaml").task
    problem = replace(problem, limit_surface=ELLIPSOID)
    plan = solve(problem, **SMALL)
    assert plan.status == "no_plan"
    assert "at this resolution" in plan.reason
    assert "the nearest that the object comes to its goal" in plan.reason
    assert verify(problem, plan).verdict == "unknown"


def test_without_time_there_is_no_plan_and_no_claim():
    plan = solve(square_problem(goal=np.array([0.1, 0.05, 2.0])), time_limit=1e-3)
    assert plan.status == "time_limit"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["tee", "box_ellipsoid", "triangle_point", "round_the_wall", "slit"])
def test_shipped_problems_end_as_they_say(name):
    problem = read_problem(FOLDER / f"{name}.yaml")
    plan = solve(problem.task, **problem.options)
    assert plan.status == ("no_plan" if name == "slit" else "solved"), plan.reason
    if plan.found:
        report = verify(problem.task, plan)
        assert report.verdict == "sound", str(report)
