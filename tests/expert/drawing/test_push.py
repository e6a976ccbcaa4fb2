from pathlib import Path

import pytest

from expert.drawing.marks import FINGER, FINGER_FORCE, GOAL, OBJECT, PATH
from expert.drawing.push import draw
from expert.errors import InvalidProblem
from expert.problems.push import PushPlan
from tests.support.pictures import coloured, frames_of
from tests.support.pushes import square_problem, straight_push

PLAN = straight_push(way=((-0.1, 0.03), (-0.06, 0.0)))


def test_a_strip_shows_object_goal_way_push_and_finger(tmp_path: Path):
    draw(square_problem(), PLAN, tmp_path / "a.png")
    (picture,) = frames_of(tmp_path / "a.png")
    assert coloured(picture, OBJECT).mean() > 0.01
    for colour, least in ((GOAL, 50), (PATH, 5), (FINGER_FORCE, 20), (FINGER, 20)):
        assert coloured(picture, colour).sum() > least


def test_an_animation_moves_the_finger_and_then_the_object(tmp_path: Path):
    draw(square_problem(), PLAN, tmp_path / "a.gif")
    frames = frames_of(tmp_path / "a.gif")
    assert len(frames) > 15
    lefts = [coloured(frame[:-60], OBJECT, 4).any(axis=0).argmax() for frame in frames]
    assert lefts[-1] > lefts[0] + 20
    assert lefts[1] == lefts[0]


def test_an_answer_without_plan_shows_start_and_goal(tmp_path: Path):
    draw(square_problem(), PushPlan(status="no_plan"), tmp_path / "a.png")
    (picture,) = frames_of(tmp_path / "a.png")
    assert coloured(picture, OBJECT).mean() > 0.01
    assert coloured(picture, GOAL).sum() > 50


def test_a_problem_file_has_nothing_to_draw(tmp_path: Path):
    with pytest.raises(InvalidProblem, match="solve it first"):
        draw(square_problem(), None, tmp_path / "a.png")
