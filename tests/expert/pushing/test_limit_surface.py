import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from expert.errors import InvalidProblem
from expert.geometry.pose import cross
from expert.pushing.limit_surface import (
    FREE,
    SLIDING,
    STICKING,
    Surface,
    characteristic,
    ellipsoid,
    motion,
    uniform,
)
from expert.world.shape import Shape

SQUARE = Shape(vertices=[[-1, -1], [1, -1], [1, 1], [-1, 1]])
SURFACES = [ellipsoid(0.77), uniform(SQUARE)]
along = st.floats(-0.9, 0.9)
directions = st.floats(-1.4, 1.4)
frictions = st.floats(0.0, 1.0)


def wrench(surface: Surface, twist) -> np.ndarray:
    """Of the finger that moves the object with a twist: against the support's friction (up to a factor)."""
    vx, vy, spin = twist
    if not len(surface.shares):
        return np.array([vx, vy, surface.squared * spin])
    v = np.array([vx, vy]) + spin * np.stack([-surface.points[:, 1], surface.points[:, 0]], -1)
    unit = v / np.linalg.norm(v, axis=1, keepdims=True)
    force = surface.shares @ unit
    return np.array([*force, surface.shares @ cross(surface.points, unit)])


def pushed(surface, x, direction, friction):
    """A finger below the square, at (x, -1), moving up with an angle; normal up."""
    u = np.array([np.sin(direction), np.cos(direction)])
    return motion(surface, x, -1.0, 0.0, 1.0, u[0], u[1], friction), u


@pytest.mark.parametrize("surface", SURFACES, ids=["ellipsoid", "uniform"])
@settings(deadline=None)  # the first call compiles
@given(x=along, direction=directions, friction=frictions)
def test_the_law_of_contact_holds(surface, x, direction, friction):
    """The force acts at the contact, in the cone; sticking: the point moves with the finger; sliding: on the cone's edge."""
    (vx, vy, spin, mode), u = pushed(surface, x, direction, friction)
    fx, fy, torque = wrench(surface, (vx, vy, spin))
    assert torque == pytest.approx(x * fy + fx, abs=2e-3 * np.hypot(fx, fy))
    point = np.array([vx + spin, vy + spin * x])
    assert point[1] == pytest.approx(u[1], abs=1e-6)
    if mode == STICKING:
        assert point == pytest.approx(u, abs=1e-6)
        assert abs(fx) <= friction * fy + 2e-3
    else:
        assert mode == SLIDING
        assert abs(fx) == pytest.approx(friction * fy, abs=2e-3 * np.hypot(fx, fy))
        assert fx * (u - point)[0] >= -1e-6  # friction pulls the object after the finger


@pytest.mark.parametrize("surface", SURFACES, ids=["ellipsoid", "uniform"])
@settings(deadline=None)  # the first call compiles
@given(x=along, direction=directions, friction=frictions)
def test_the_object_turns_as_the_vote_says(surface, x, direction, friction):
    """Mason's voting theorem: the edges of the friction cone and the push vote on the sense of rotation."""
    (_, _, spin, _), u = pushed(surface, x, direction, friction)
    rays = np.array([[friction, 1.0], [-friction, 1.0], u])
    votes = cross(np.array([x, -1.0]), rays)
    if abs(votes).min() > 1e-3:
        assert np.sign(spin) == np.sign(np.sign(votes).sum())


def test_a_finger_that_leaves_moves_nothing():
    assert motion(SURFACES[0], 0.3, -1.0, 0.0, 1.0, 0.2, -1.0, 0.5) == (0.0, 0.0, 0.0, FREE)


def test_the_characteristic_length_of_a_square_is_known():
    """Uniform pressure on a square of side 2: the mean distance to the centre is (sqrt 2 + asinh 1) / 3."""
    assert characteristic(uniform(SQUARE, 40)) == pytest.approx((np.sqrt(2) + np.arcsinh(1)) / 3, rel=2e-3)
    assert characteristic(ellipsoid(0.4)) == pytest.approx(0.4)


def test_pressure_points_lie_about_the_centroid():
    tee = Shape(vertices=[[-1, -5], [1, -5], [1, 1], [5, 1], [5, 3], [-5, 3], [-5, 1], [-1, 1]])
    surface = uniform(tee)
    assert surface.shares.sum() == pytest.approx(1)
    assert surface.shares @ surface.points == pytest.approx([0, 0], abs=1e-9)


def test_an_ellipsoid_needs_a_length():
    with pytest.raises(InvalidProblem, match="limit_surface"):
        ellipsoid(0.0)


def test_characteristic_lengths_of_a_rectangle_and_of_a_disc_are_known():
    """Mean distances to the centre: of a rectangle a x b by its diagonal d, and two thirds of a disc's radius."""
    a, b = 4.0, 1.0
    rectangle = Shape(vertices=[[0, 0], [a, 0], [a, b], [0, b]])
    d = np.hypot(a, b)
    mean = (d + a**2 / (2 * b) * np.log((b + d) / a) + b**2 / (2 * a) * np.log((a + d) / b)) / 6
    assert characteristic(uniform(rectangle, 60)) == pytest.approx(mean, rel=2e-3)
    angles = np.linspace(0, 2 * np.pi, 120, endpoint=False)
    disc = Shape(vertices=np.stack([np.cos(angles), np.sin(angles)], -1))
    assert characteristic(uniform(disc, 40)) == pytest.approx(2 / 3, rel=2e-3)
