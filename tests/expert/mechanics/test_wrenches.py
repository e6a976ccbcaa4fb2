"""Cones and wrenches of small examples that can be worked out by hand."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from expert.geometry.pose import Array
from expert.mechanics import (
    friction_rays,
    inertial_wrench,
    wrench_about,
)
from expert.world.motion import Trajectory
from tests.support.hand_plans import (
    SQUARE,
    WEIGHT,
    A,
    sliding_block,
    task_of,
)


def test_friction_rays_have_unit_normal_component_and_slope_mu() -> None:
    normal = np.array([0.6, 0.8])
    rays = friction_rays(normal, 0.3)
    np.testing.assert_allclose(rays @ normal, 1)
    np.testing.assert_allclose(np.sort(rays @ [0.8, -0.6]), [-0.3, 0.3])


def test_a_block_at_rest_needs_its_weight_carried() -> None:
    task = task_of([[0, A, 0]] * 3, count=1)
    np.testing.assert_allclose(inertial_wrench(task), np.tile([0, WEIGHT, 0], (3, 1)), atol=1e-15)


def test_inertial_wrench_of_a_known_acceleration() -> None:
    """x = t^2 / 2 at 1 m/s^2 and theta = t^2 at 2 rad/s^2, by exact second differences."""
    t = 0.1 * np.arange(-1, 5)
    q = np.column_stack([t**2 / 2, 0 * t + 1.0, t**2])
    task = task_of(q[1:-1], count=1)
    task = replace(task, trajectory=Trajectory(dt=0.1, poses=q[1:-1], before=q[0], after=q[-1]))
    inertia = 0.01 * (0.1**2 + 0.1**2) / 12
    np.testing.assert_allclose(
        inertial_wrench(task), np.tile([0.01, WEIGHT, 2 * inertia], (4, 1)), atol=1e-12
    )


VECTOR = st.tuples(st.floats(-5, 5), st.floats(-5, 5)).map(np.array)


@given(VECTOR, VECTOR, VECTOR, VECTOR)
def test_moments_shift_with_their_centre(force: Array, point: Array, one: Array, other: Array) -> None:
    """Varignon: the moment about another centre differs by the cross product of the shift and the force."""
    moved = wrench_about(force, point, one) - wrench_about(force, point, other)
    shift = other - one
    np.testing.assert_allclose(moved, [0, 0, shift[0] * force[1] - shift[1] * force[0]], atol=1e-10)


def test_the_square_s_inertia_is_the_textbook_s() -> None:
    body = sliding_block()[0].body
    assert body.inertia == pytest.approx(0.01 * 2 * (2 * A) ** 2 / 12)
    np.testing.assert_array_equal(body.vertices, SQUARE)
