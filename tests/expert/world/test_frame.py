"""Relative lengths and back: one similarity for cages, grasps and executions."""

import numpy as np
import pytest

from expert.geometry.pose import to_world
from expert.world.frame import Frame
from expert.world.shape import Shape
from tests.support.polygons import random_polygon

RNG = np.random.default_rng(3)
SHAPE = Shape(vertices=random_polygon(RNG, 7) + [0.3, -0.2])
POSE = np.array([0.4, -0.1, 2.5])
ENCLOSING, OTHER = Frame.of(SHAPE, POSE), Frame(np.array([0.1, 0.2]), 0.7, POSE)


@pytest.mark.parametrize("frame", [ENCLOSING, OTHER])
def test_points_and_poses_return_as_they_left(frame: Frame) -> None:
    points, poses = RNG.normal(size=(5, 2)), RNG.normal(size=(4, 6, 3))
    np.testing.assert_allclose(frame.world(frame.relative(points)), points, atol=1e-14)
    np.testing.assert_allclose(frame.world_pose(frame.configuration(poses)), poses, atol=1e-14)


@pytest.mark.parametrize("frame", [ENCLOSING, OTHER])
def test_a_moved_object_is_the_same_in_both_lengths(frame: Frame) -> None:
    """Corners at a configuration, in relative lengths, are the corners at its pose, in metres."""
    configuration = np.array([0.3, -0.7, 0.9])
    relative = to_world(configuration, frame.body(SHAPE.vertices))
    corners = to_world(frame.world_pose(configuration), SHAPE.vertices)
    np.testing.assert_allclose(frame.relative(corners), relative, atol=1e-13)
    np.testing.assert_allclose(frame.configuration(POSE), 0, atol=1e-15)


def test_the_enclosing_circle_has_radius_one_and_touches_the_object() -> None:
    distances = np.linalg.norm(ENCLOSING.body(SHAPE.vertices), axis=1)
    assert distances.max() == pytest.approx(1)
    assert np.sum(distances > 1 - 1e-9) >= 2
