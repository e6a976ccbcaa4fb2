import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from expert.geometry.polygon import mass_properties
from expert.geometry.pose import cross, perpendicular
from expert.problems.push import LimitSurface
from expert.pushing.limit_surface import ellipsoid, motion, uniform
from expert.verify.push.law import Ellipsoid, Face, answer, support, vote
from tests.support.pushes import SQUARE, TEE

CENTROID = mass_properties(TEE.vertices).centroid
FACE, SMOOTH = Face.of(TEE, CENTROID), Ellipsoid(0.03)
NORMAL = np.array([0.0, 1.0])
places, slants = st.floats(-0.009, 0.009), st.floats(-1.3, 1.3)
frictions = st.floats(0.0, 0.8)


def contact(x: float, slant: float):
    """A finger below the T's stem, going up at an angle."""
    return np.array([x, -0.05]) - CENTROID, np.array([np.sin(slant), np.cos(slant)])


@pytest.mark.parametrize(("under", "theirs"), [(SMOOTH, ellipsoid(0.03)), (FACE, uniform(TEE, 60))])
@settings(deadline=None, max_examples=40)
@given(x=places, slant=slants, friction=frictions)
def test_two_laws_that_were_written_apart_agree(under, theirs, x, slant, friction):
    """The model of the search on a fine grid against the checker's, which shares nothing with it."""
    at, u = contact(x, slant)
    mine = answer(under, at, NORMAL, u, friction)
    vx, vy, spin, _ = motion(theirs, *at, *NORMAL, *u, friction)
    assert mine.velocity == pytest.approx([vx, vy], abs=6e-3)
    assert mine.spin == pytest.approx(spin, abs=6e-3 / 0.03)


@pytest.mark.parametrize("under", [SMOOTH, FACE])
@settings(deadline=None, max_examples=60)
@given(x=places, slant=slants, friction=frictions)
def test_the_object_turns_as_the_vote_says(under, x, slant, friction):
    at, u = contact(x, slant)
    moved = answer(under, at, NORMAL, u, friction)
    sides = [cross(at, r) for r in ([friction, 1.0], [-friction, 1.0], u)]
    if np.abs(sides).min() > 1e-4:
        assert np.sign(moved.spin) == vote(at, NORMAL, u, friction)


@pytest.mark.parametrize("under", [SMOOTH, FACE])
@settings(deadline=None, max_examples=40)
@given(x=places, slant=slants, friction=frictions)
def test_the_force_is_in_the_cone_and_friction_drags_the_object_along(under, x, slant, friction):
    at, u = contact(x, slant)
    moved = answer(under, at, NORMAL, u, friction)
    touched = moved.velocity + moved.spin * perpendicular(at)
    assert touched[1] == pytest.approx(u[1], abs=1e-6)
    assert abs(moved.force[0]) <= friction * moved.force[1] * (1 + 1e-5) + 1e-7 * np.linalg.norm(moved.force)
    if moved.mode == "sticking":
        assert touched == pytest.approx(u, abs=1e-6)
    else:
        assert (u - touched)[0] * moved.force[0] >= -1e-9


def test_a_finger_that_leaves_moves_nothing():
    at, _ = contact(0.0, 0.0)
    moved = answer(SMOOTH, at, NORMAL, np.array([0.3, -1.0]), 0.5)
    assert (moved.mode, moved.spin) == ("free", 0.0)


def test_the_face_has_the_area_and_the_centroid_of_the_shape():
    assert FACE.areas.sum() == pytest.approx(mass_properties(TEE.vertices).area)
    assert FACE.areas @ FACE.points == pytest.approx([0, 0], abs=1e-12)


def test_a_problem_s_surface_is_the_one_it_names():
    assert isinstance(support(LimitSurface(), SQUARE, np.zeros(2)), Face)
    assert support(LimitSurface(kind="ellipsoid", c=0.02), SQUARE, np.zeros(2)) == Ellipsoid(0.02)
