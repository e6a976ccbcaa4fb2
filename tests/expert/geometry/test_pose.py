"""Rigid motions of the plane keep what rigid motions keep."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from expert.geometry.pose import Array, cross, moved_origin, perpendicular, rotation, to_body, to_world

COORDINATE = st.floats(-10, 10)
POSE = st.tuples(COORDINATE, COORDINATE, st.floats(-7, 7)).map(np.array)
POINTS = st.lists(st.tuples(COORDINATE, COORDINATE), min_size=2, max_size=6).map(np.array)
VECTOR = st.tuples(COORDINATE, COORDINATE).map(np.array)


@given(POSE, POINTS)
def test_body_and_world_frames_are_inverse(pose: Array, points: Array) -> None:
    np.testing.assert_allclose(to_body(pose, to_world(pose, points)), points, atol=1e-12)
    np.testing.assert_allclose(to_world(pose, to_body(pose, points)), points, atol=1e-12)


@given(POSE, POINTS)
def test_motions_keep_distances_and_orientation(pose: Array, points: Array) -> None:
    moved = to_world(pose, points)
    np.testing.assert_allclose(
        np.linalg.norm(moved[1:] - moved[:-1], axis=1),
        np.linalg.norm(points[1:] - points[:-1], axis=1),
        atol=1e-12,
    )
    u, v = points[1] - points[0], points[-1] - points[0]
    np.testing.assert_allclose(cross(moved[1] - moved[0], moved[-1] - moved[0]), cross(u, v), atol=1e-11)


@given(st.floats(-7, 7), st.floats(-7, 7))
def test_rotations_compose_by_adding_angles(alpha: float, beta: float) -> None:
    np.testing.assert_allclose(rotation(alpha) @ rotation(beta), rotation(alpha + beta), atol=1e-12)


def test_a_quarter_turn_is_counter_clockwise() -> None:
    np.testing.assert_allclose(to_world([1.0, 2.0, np.pi / 2], [[1.0, 0.0]]), [[1.0, 3.0]], atol=1e-15)
    np.testing.assert_array_equal(perpendicular([1.0, 0.0]), [0.0, 1.0])


def test_poses_and_points_broadcast() -> None:
    poses = np.array([[0.0, 0, 0], [1, 0, np.pi]])
    points = np.array([[1.0, 2], [3, 4], [5, 6]])
    world = to_world(poses, points)
    assert world.shape == (2, 3, 2)
    np.testing.assert_allclose(world[1], [1, 0] - points, atol=1e-14)


@given(VECTOR, VECTOR)
def test_cross_product_is_the_product_with_the_perpendicular(u: Array, v: Array) -> None:
    np.testing.assert_allclose(cross(u, v), perpendicular(u) @ v, atol=1e-12)
    np.testing.assert_allclose(cross(u, v), -cross(v, u), atol=1e-12)


@given(POSE, VECTOR, POINTS)
def test_a_moved_origin_leaves_the_body_where_it_is(pose: Array, origin: Array, points: Array) -> None:
    moved = moved_origin(pose, origin)
    np.testing.assert_allclose(to_world(moved, points - origin), to_world(pose, points), atol=1e-12)
    np.testing.assert_allclose(moved_origin(moved, -origin), pose, atol=1e-12)
