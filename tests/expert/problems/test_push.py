import re

import numpy as np
import pytest

from expert.errors import InvalidProblem
from expert.problems.push import Finger, LimitSurface, PushOptions, PushProblem, Tolerance, duration
from expert.world.walls import Obstacle
from tests.support.pushes import SQUARE, TEE, square_problem, straight_push

WALL = Obstacle(vertices=[[0.05, -0.2], [0.06, -0.2], [0.06, 0.2], [0.05, 0.2]], name="obstacles[0]")
BESIDE = Finger(start=np.array([-0.1, 0.0]), radius=0.01)


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        (
            {"goal": np.array([0.5, 0, 0]), "workspace": [-0.2, -0.2, 0.2, 0.2]},
            "goal: expected a pose at which",
        ),
        ({"start": np.array([0.03, 0, 0]), "obstacles": (WALL,)}, "start: .* inside obstacles.0."),
        ({"goal": np.array([0.0095, 0, 0]), "obstacles": (WALL,)}, "goal: .* keeps 0.002 m .* 0.0005 m to"),
        (
            {"workspace": [-0.045, -0.045, 0.045, 0.045], "goal": [0.002, 0, 0], "finger": BESIDE},
            "finger.radius: expected a finger that fits, got 0.01 m, which fits nowhere",
        ),
        ({"finger": Finger(start=[-0.04, 0], radius=0.01)}, "finger.start: expected a place 0.002 m clear"),
        ({"finger": Finger(start=[-0.5, 0]), "workspace": [-0.2, -0.2, 0.2, 0.2]}, "finger.start"),
        ({"workspace": [0.2, -0.2, -0.2, 0.2]}, "workspace: expected x_min < x_max"),
        ({"clearance": 0.0}, "clearance: expected a positive length"),
        ({"start": [0, 0]}, "start: expected numbers of shape"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(changes, complaint):
    with pytest.raises(InvalidProblem, match=complaint) as refusal:
        square_problem(**changes)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("make", "complaint"),
    [
        (lambda: LimitSurface(kind="ellipsoid"), "limit_surface.c: expected a positive length"),
        (lambda: LimitSurface(kind="uniform", c=0.1), "limit_surface.c: expected none"),
        (lambda: LimitSurface(kind="cube"), "limit_surface.kind: expected uniform or ellipsoid"),
        (lambda: Finger(start=[0, 0], friction=-1.0), "finger.friction"),
        (lambda: Finger(start=[0, 0], push_speed=0.0), "finger.push_speed"),
        (lambda: Tolerance(angle=0.0), "tolerance.angle"),
        (lambda: PushOptions(depth=0), "options.depth"),
    ],
)
def test_values_that_mean_nothing_are_refused(make, complaint):
    with pytest.raises(InvalidProblem, match=re.escape(complaint)):
        make()


def test_a_workspace_that_is_not_stated_has_room_around_start_goal_and_finger():
    problem = square_problem()
    low, high = problem.bounds[:2], problem.bounds[2:]
    reach = np.concatenate([problem.outline(problem.start), problem.outline(problem.goal), [[-0.1, 0.0]]])
    assert (reach - low > 0.07).all()
    assert (high - reach > 0.07).all()


def test_a_point_finger_is_a_small_disc():
    problem = PushProblem(shape=TEE, start=np.zeros(3), goal=np.zeros(3), finger=Finger(start=[-0.1, -0.1]))
    assert 0 < problem.radius == pytest.approx(1e-3 * TEE.size)
    assert square_problem().radius == 0.01
    assert problem.centroid != pytest.approx([0, 0])
    assert SQUARE.size == pytest.approx(0.08 * np.sqrt(2))


def test_the_duration_is_that_of_ways_and_pushes():
    finger = Finger(start=np.array([-0.1, 0]), push_speed=0.05, travel_speed=0.2)
    plan = straight_push(way=[(-0.1, 0.04), (-0.06, 0.04)], end=(0.05, 0.04))
    assert duration(finger, plan.pushes) == pytest.approx(0.08 / 0.2 + 0.11 / 0.05)
