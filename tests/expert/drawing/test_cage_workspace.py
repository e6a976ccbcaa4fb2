"""The workspace of a cage: everything where it is, in its colour."""

from dataclasses import replace

import numpy as np
import pytest

from expert.drawing.cage_workspace import draw_scene, draw_workspace, lengths_along
from expert.drawing.canvas import framed_axes, new_figure
from expert.drawing.marks import EDGE, FINGERS, OBJECT, PATH, WALL
from expert.geometry.pose import to_world
from expert.problems.cage import Arrangement, CageProblem
from expert.verify.cage.check import verify_cage
from expert.world.fingers import Gripper
from expert.world.named import named_shape
from expert.world.shape import Shape
from expert.world.walls import segments
from tests.support.pictures import coloured, shown_at, texts

SHAPE = Shape(vertices=named_shape("I"))
GRIPPER = Gripper(fingers=(0, 1), opening=(0.0, 0.2))
TASK = CageProblem(
    shape=SHAPE,
    pose=np.zeros(3),
    count=2,
    fixed=np.array([[0.0, 0.07]]),
    grippers=(GRIPPER,),
    walls=segments([[[-0.06, -0.055], [0.06, -0.055]]]),
)
CAGED = TASK.arrangement(np.array([[-0.02, 0], [0.02, 0]]))
LEAVING = replace(CAGED, fingers=np.array([[-0.02, 0], [0.08, 0]]), walls=())


def test_object_fingers_and_walls_are_where_they_are() -> None:
    figure = new_figure(4, 4)
    axes = figure.add_subplot()
    draw_scene(axes, TASK, CAGED, CAGED.pose)
    framed_axes(axes, np.concatenate([SHAPE.vertices, CAGED.fingers]), 0.2)
    image, places = shown_at(figure, axes, np.concatenate([CAGED.fingers, [[0.0, 0.04], [-0.04, 0.0]]]))
    colours = [FINGERS[0], FINGERS[1], EDGE, OBJECT]
    assert [coloured(image, c)[tuple(p)] for c, p in zip(colours, places, strict=False)] == [True] * 4
    assert tuple(image[tuple(places[4])]) == (255, 255, 255)
    assert texts(figure) == ["0", "1", "2"]
    assert coloured(image, WALL).sum() > 100


def test_the_fingers_of_a_gripper_are_joined_and_the_picture_has_a_scale() -> None:
    figure = new_figure(4, 4)
    axes = figure.add_subplot()
    draw_workspace(axes, TASK, CAGED, verify_cage(CAGED))
    dashed = [line for line in axes.lines if line.get_linestyle() == "--"]
    np.testing.assert_array_equal(dashed[0].get_xydata(), CAGED.fingers[:2])
    assert texts(figure)[0] == "workspace"
    assert texts(figure)[-1].endswith(" mm")


def test_a_way_out_is_shown_by_fainter_and_fainter_outlines() -> None:
    report = verify_cage(LEAVING)
    assert report.verdict == "escapes"
    axes = new_figure(4, 4).add_subplot()
    draw_workspace(axes, LEAVING, LEAVING, report)
    outlines = [line for line in axes.lines if line.get_color() == PATH]
    strength = [line.get_alpha() for line in outlines]
    assert len(outlines) == 5
    assert strength == sorted(strength, reverse=True)
    for line in outlines:
        sides = np.linalg.norm(np.diff(line.get_xydata(), axis=0), axis=1)
        a = SHAPE.vertices
        np.testing.assert_allclose(sides, np.linalg.norm(np.roll(a, -1, axis=0) - a, axis=1))


def test_lengths_along_a_path_count_translations_and_turns_of_the_rim() -> None:
    path = np.array([[0, 0, 0], [0.3, 0.4, 0], [0.3, 0.4, 1.0]])
    np.testing.assert_allclose(lengths_along(CAGED, path), [0, 0.5, 0.5 + SHAPE.size / 2])
    assert to_world(path[1], SHAPE.vertices).shape == SHAPE.vertices.shape


def test_a_gripper_that_opens_one_parameter_has_its_centre() -> None:
    tripod = replace(TASK, count=3, grippers=(), fixed=np.empty((0, 2)), cost="max_opening", walls=())
    opening, u = 0.09, np.array([[0, 1], [-np.sqrt(0.5), -np.sqrt(0.5)], [np.sqrt(0.5), -np.sqrt(0.5)]])
    three = Arrangement(shape=SHAPE, pose=np.zeros(3), fingers=[0.001, 0.002] + opening * u)
    axes = new_figure(4, 4).add_subplot()
    draw_workspace(axes, tripod, three, verify_cage(three))
    spokes = [line.get_xydata() for line in axes.lines if line.get_linestyle() == "--"]
    assert len(spokes) == 3
    for spoke, finger in zip(spokes, three.fingers, strict=True):
        assert spoke[0] == pytest.approx([0.001, 0.002])
        assert spoke[1] == pytest.approx(finger)
