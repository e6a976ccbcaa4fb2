"""Panels of the figures of certified grasps."""

import numpy as np
import pytest

from expert.drawing.canvas import new_figure
from expert.drawing.grasp_figures import LEAST_ERROR, draw_errors, draw_poses, draw_start_set
from expert.drawing.marks import FINGER, GOAL, PATH, START
from expert.problems.grasp import GraspProblem, GraspSolution
from expert.world.shape import Shape
from tests.support.pictures import coloured, shown_at, texts

CORNERS = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
TASK = GraspProblem(shape=Shape(vertices=0.05 * CORNERS), pose=np.array([0.02, 0.0, 0.0]))
CONTACTS = np.array([[0.015, -0.05], [0.05, -0.015], [-0.015, 0.05], [-0.05, 0.015]]) + TASK.pose[:2]
OUTWARD = np.array([[0, -1], [1, 0], [0, 1], [-1, 0]])
ANSWER = GraspSolution(status="uncertified", path=np.stack([CONTACTS + 0.008 * OUTWARD, CONTACTS]))


def test_the_set_of_starts_is_filled_at_true_scale() -> None:
    """Four fingers, 8 mm away from a square's sides, leave its middle a square of 16 mm."""
    figure = new_figure(4, 4)
    axes = figure.add_subplot()
    draw_start_set(axes, TASK, ANSWER)
    image, places = shown_at(figure, axes, TASK.pose[:2] + 0.007 * CORNERS)
    assert coloured(image, PATH)[tuple(places.T)].all()
    image, places = shown_at(figure, axes, TASK.pose[:2] + 0.009 * CORNERS)
    assert not coloured(image, PATH)[tuple(places.T)].any()
    assert {"0", "1", "2", "3"} < set(texts(figure))


def test_poses_are_grey_around_the_goal() -> None:
    figure = new_figure(4, 4)
    axes = figure.add_subplot()
    poses = TASK.pose + np.array([[0.0, 0, 0.1], [0, 0, -0.1]])
    draw_poses(axes, TASK, poses, CONTACTS, "ends")
    assert [line.get_color() for line in axes.lines[:3]] == [START, START, GOAL]
    image, places = shown_at(figure, axes, CONTACTS)
    assert coloured(image, FINGER)[tuple(places.T)].all()
    assert texts(figure)[0] == "ends"


def test_errors_that_are_rounding_lie_at_the_bottom() -> None:
    axes = new_figure(4, 4).add_subplot()
    draw_errors(axes, {"poor": np.array([0.1, 0.2]), "exact": np.array([1e-17, 0.0])})
    assert axes.get_yscale() == "log"
    heights = np.concatenate([line.get_ydata() for line in axes.lines])
    assert heights.min() == LEAST_ERROR
    assert heights.max() == pytest.approx(0.2)
    assert [t.get_text() for t in axes.get_xticklabels()] == ["poor", "exact"]
