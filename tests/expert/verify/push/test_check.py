import itertools
from dataclasses import replace

import numpy as np
import pytest

from expert.errors import InvalidProblem
from expert.problems.push import Finger, LimitSurface, Push, PushPlan, duration
from expert.verify.push.check import verify
from expert.verify.push.law import support
from expert.verify.push.motion import course
from expert.world.walls import Obstacle
from tests.support.pushes import TEE, square_problem, straight_push

WALL = Obstacle(vertices=[[-0.2, 0.06], [0.3, 0.06], [0.3, 0.08], [-0.2, 0.08]])


def violated(problem, plan) -> set[str]:
    report = verify(problem, plan)
    assert report.verdict == ("refuted" if report.violations else "sound"), str(report)
    return {check.name for check in report.violations}


@pytest.mark.parametrize("surface", [LimitSurface(), LimitSurface(kind="ellipsoid", c=0.03)])
def test_a_push_through_the_middle_is_sound(surface):
    problem = square_problem(limit_surface=surface)
    report = verify(problem, straight_push())
    assert report.verdict == "sound", str(report)
    assert report.ends[-1] == pytest.approx((0.1, 0, 0), abs=1e-6)
    assert report.sliding == 0
    assert {check["check"] for check in report.as_dict()["checks"]} >= {"goal, position", "voting theorem"}


@pytest.mark.parametrize(
    ("lie", "laws"),
    [
        ({"end": (0.04, 0.0)}, {"goal, position", "claimed positions"}),
        ({"way": ((-0.06, 0.01),), "end": (0.05, 0.01)}, {"goal, angle", "claimed angles", "goal, position"}),
        ({"pose": (0.11, 0, 0)}, {"claimed positions"}),
        ({"pose": (0.1, 0, 0.1)}, {"claimed angles"}),
        ({"way": ((0.1, 0.0), (-0.06, 0.0))}, {"finger in object"}),
        ({"way": ((-0.06, -5.0), (-0.06, 0.0))}, {"finger in obstacles"}),
    ],
)
def test_what_is_false_is_refuted_by_the_law_that_it_breaks(lie, laws):
    found = violated(square_problem(), straight_push(**lie))
    assert laws & found
    assert found <= laws | {"claimed positions"}


def test_a_turn_against_the_vote_is_refuted():
    """Pushed below its middle, the square turns to the left; claimed to turn to the right."""
    plan = straight_push(way=((-0.06, -0.02),), end=(-0.02, -0.02), pose=(0.02, 0, -0.3))
    assert "voting theorem" in violated(square_problem(), plan)


def test_a_wrong_duration_is_refuted():
    plan = replace(straight_push(), objective=1.0)
    assert violated(square_problem(), plan) == {"objective"}


def test_what_hits_an_obstacle_is_refuted():
    corner = Obstacle(vertices=[[0.0, 0.0421], [0.1, 0.0421], [0.1, 0.1], [0.0, 0.1]])
    plan = straight_push(way=((-0.06, -0.02),), end=(0.0, -0.02), pose=(0.05, 0.01, 0.9))
    assert "object in obstacles" in violated(square_problem(obstacles=(corner,)), plan)
    plan = straight_push(way=((-0.1, 0.07), (-0.06, 0.0)))
    assert violated(square_problem(obstacles=(WALL,)), plan) == {"finger in obstacles"}


def test_the_second_push_begins_where_the_first_one_ended():
    problem = square_problem()
    half = Push(way=np.array([[-0.06, 0]]), end=np.array([0.0, 0]), pose=np.array([0.05, 0, 0]))
    rest = Push(way=np.array([[-0.01, 0], [0.0, 0]]), end=np.array([0.05, 0]), pose=np.array([0.1, 0, 0]))
    pushes = (half, rest)
    plan = PushPlan(status="solved", pushes=pushes, objective=duration(problem.finger, pushes))
    assert violated(problem, plan) == set()
    plan = replace(plan, pushes=(half,), objective=duration(problem.finger, (half,)))
    assert violated(problem, plan) == {"goal, position"}


def test_two_contacts_at_once_are_not_judged():
    finger = Finger(start=np.array([0.1, -0.1]), radius=0.01, friction=0.3)
    problem = square_problem(shape=TEE, finger=finger)
    push = Push(way=np.array([[0.05, -0.03]]), end=np.array([0.0, 0.02]), pose=np.zeros(3))
    report = verify(problem, PushPlan(status="solved", pushes=(push,), objective=1.0))
    assert report.verdict == "unknown"
    assert "two places" in report.reason


def test_an_answer_without_plan_proves_nothing():
    report = verify(square_problem(), PushPlan(status="no_plan", reason="none"))
    assert report.verdict == "unknown"
    with pytest.raises(InvalidProblem, match="solve it first"):
        verify(square_problem(), None)


def test_the_integration_converges():
    """Shorter steps change the end by less and less."""
    problem = square_problem(finger=Finger(start=np.array([-0.1, 0]), radius=0.01, friction=0.2))
    under = support(problem.limit_surface, problem.shape, problem.centroid)
    start, end = np.array([-0.06, 0.015]), np.array([0.02, 0.015])
    ends = [course(problem, under, problem.start, start, end, 0.016 / 2**k).poses[-1] for k in range(4)]
    changes = [np.abs(b - a).max() for a, b in itertools.pairwise(ends)]
    assert changes[-1] < 0.5 * changes[0]
    assert changes[-1] < 3e-4
