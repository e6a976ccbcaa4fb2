"""Pictures of certified grasps exist, show what they say, and are refused where there is nothing to show."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from expert.drawing.certified_grasp import draw, grasp_figure, outcome
from expert.drawing.marks import FINGER, OBJECT
from expert.errors import InvalidProblem
from expert.grasping.executions import executions
from expert.problems.grasp import GraspProblem, GraspSolution
from expert.world.shape import Shape
from tests.support.pictures import coloured, frames_of, shown_at, texts

CORNERS = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
TASK = GraspProblem(shape=Shape(vertices=0.05 * CORNERS), pose=np.array([0.02, 0.0, 0.0]))
CONTACTS = np.array([[0.015, -0.05], [0.05, -0.015], [-0.015, 0.05], [-0.05, 0.015]]) + TASK.pose[:2]
OUTWARD = np.array([[0, -1], [1, 0], [0, 1], [-1, 0]])
ANSWER = GraspSolution(
    status="uncertified",
    path=np.stack([CONTACTS + d * OUTWARD for d in (0.008, 0.006, 0.004, 0.002, 0.0)]),
)


def test_a_picture_shows_all_runs_and_where_they_end() -> None:
    runs = executions(TASK, ANSWER, 10)
    figure = grasp_figure(TASK, ANSWER, runs)
    words = texts(figure)
    assert words[0] == "uncertified: all 10 random starts end at the goal, within 1.4 µm and 0.01°"
    assert len(figure.axes) == 3 + len(ANSWER.path)
    assert [f"knot {k}" for k in range(5)] == [word for word in words if word.startswith("knot ")]
    assert {"starts", "goal", "finger at the start", "finger at the end", "finger path", "executions"} <= set(
        words
    )
    assert sum(word.endswith(" mm") for word in words) == 2 + len(ANSWER.path)
    assert not any(re.search(r"e-\d\d", word) for word in words)


def test_fingers_are_hollow_at_the_start_and_full_at_the_end_of_their_paths() -> None:
    figure = grasp_figure(TASK, ANSWER, executions(TASK, ANSWER, 10))
    image, ends = shown_at(figure, figure.axes[0], ANSWER.path[-1])
    assert coloured(image, FINGER)[tuple(ends.T)].all()
    image, starts = shown_at(figure, figure.axes[0], ANSWER.path[0])
    assert (image[tuple(starts.T)] == 255).all()
    last = figure.axes[-1]
    image, middle = shown_at(figure, last, TASK.pose[None, :2])
    assert coloured(image, OBJECT)[tuple(middle.T)].all()


def test_runs_that_end_elsewhere_are_counted_in_readable_units() -> None:
    runs = executions(TASK, ANSWER, 4)
    ends = runs.poses.copy()
    ends[0, -1] += [0.003, 0, 0]
    ends[1, -1] += [2e-5, 0, 0.02]
    stalled = np.array([1.5, np.nan, np.nan, np.nan])
    said = outcome(TASK, replace(runs, poses=ends, stalled=stalled))
    assert (
        said == "2 of 4 random starts end at the goal, the others up to 3 mm and 1.1° away, 1 jam on the way"
    )


def test_an_animation_moves_from_the_starts_to_the_goal(tmp_path: Path) -> None:
    draw(TASK, ANSWER, tmp_path / "a.gif")
    frames = frames_of(tmp_path / "a.gif")
    assert len(frames) > 20
    panel = slice(30, -60)
    shares = [coloured(frame[panel], FINGER).sum() for frame in frames]
    assert min(shares) > 50
    spread = [(frame[panel] < 250).any(axis=2).sum() for frame in (frames[0], frames[-1])]
    assert spread[0] > 1.05 * spread[1]  # many poses become one


def test_nothing_is_drawn_without_fingers_or_without_a_cage(tmp_path: Path) -> None:
    with pytest.raises(InvalidProblem, match="solve it first"):
        draw(TASK, GraspSolution(status="none_found"), tmp_path / "a.png")
    far = GraspSolution(status="uncertified", path=ANSWER.path + 3 * (ANSWER.path - TASK.pose[:2]))
    with pytest.raises(InvalidProblem, match="cage the goal"):
        draw(TASK, far, tmp_path / "a.png")
    assert list(tmp_path.iterdir()) == []
