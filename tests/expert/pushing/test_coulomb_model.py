import numpy as np
import pytest

from expert.geometry.polygon import mass_properties
from expert.geometry.pose import cross, perpendicular, rotation
from expert.pushing.coulomb_model import CoulombModel
from expert.pushing.limit_surface import ellipsoid, uniform
from tests.support.pushes import SQUARE, TEE

C, SIDE, RADIUS = 0.03, 0.04, 0.01


def model(shape=SQUARE, surface=None, friction=0.3, radius=RADIUS) -> CoulombModel:
    origin = mass_properties(shape.vertices).centroid
    surface = surface or ellipsoid(C)
    return CoulombModel(
        shape=shape, origin=origin, surface=surface, radius=radius, friction=friction, speed=0.05
    )


def pushed(made: CoulombModel, start, direction, length):
    """Pose after one push, and where the finger ends."""
    unit = np.array(direction) / np.linalg.norm(direction)
    poses, fingers = made.outcomes(np.array([start]), unit[None], np.array([length]))
    return poses[0], fingers[0]


def test_a_push_through_the_middle_moves_straight():
    for surface in (ellipsoid(C), uniform(SQUARE)):
        pose, finger = pushed(model(surface=surface), [-0.06, 0], [1, 0], 0.06)
        assert pose == pytest.approx([0.05, 0, 0], abs=1e-6)
        assert finger == pytest.approx([-SIDE - RADIUS, 0], abs=1e-6)


@pytest.mark.parametrize("y", [-0.03, -0.01, 0.02])
@pytest.mark.parametrize("slant", [-0.2, 0.0, 0.25])
def test_a_short_push_that_sticks_follows_lynch(y, slant):
    """v = (c^2 u + (r . u) r) / (c^2 + r^2) for the centre, spin = (r x v) / c^2."""
    r, u = np.array([-SIDE, y]), np.array([np.cos(slant), np.sin(slant)])
    step = 1e-5
    pose, _ = pushed(model(friction=2.0), r - [RADIUS, 0], u, step)
    v = (C**2 * u + (r @ u) * r) / (C**2 + r @ r)
    assert pose / step == pytest.approx([*v, cross(r, v) / C**2], rel=2e-3, abs=2e-3)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_short_push_outside_the_motion_cone_slides_on_the_cone_s_edge(side):
    """The velocity is that of a force along the cone's edge, scaled so that the touched point keeps up along the normal."""
    mu, r, step = 0.2, np.array([-SIDE, 0.01]), 1e-5
    u = np.array([np.cos(0.8 * side), np.sin(0.8 * side)])
    force = np.array([1.0, side * mu])
    twist = np.array([*force, cross(r, force) / C**2])
    touched = twist[:2] + twist[2] * perpendicular(r)
    twist *= u[0] / touched[0]
    pose, _ = pushed(model(friction=mu), r - [RADIUS, 0], u, step)
    assert pose / step == pytest.approx(twist, rel=2e-3, abs=2e-3)


def test_between_the_edges_of_the_motion_cone_the_contact_sticks():
    """Just inside either edge the finger keeps its place on the object; outside it does not."""
    mu, r = 0.3, np.array([-SIDE, 0.0])
    edges = []
    for side in (1.0, -1.0):
        force = np.array([1.0, side * mu])
        touched = force + cross(r, force) / C**2 * perpendicular(r)
        edges.append(np.arctan2(touched[1], touched[0]))
    for edge in edges:
        for share, stays in ((0.9, True), (1.1, False)):
            direction = [np.cos(share * edge), np.sin(share * edge)]
            _, finger = pushed(model(friction=mu, radius=1e-4), r - [1e-4, 0], direction, 1e-4)
            assert (abs(finger[1]) < 1e-7) == stays


def test_a_push_that_begins_with_another_goes_on_from_it():
    made = model(TEE, uniform(TEE))
    start, unit = np.array([-0.075, 0.01]), np.array([0.8, 0.6])
    lengths = np.array([0.02, 0.05, 0.09])
    together = made.outcomes(np.tile(start, (3, 1)), np.tile(unit, (3, 1)), lengths)[0]
    apart = [pushed(made, start, unit, length)[0] for length in lengths]
    assert together == pytest.approx(np.array(apart), abs=2e-4)
    assert np.linalg.norm(together[-1]) > 0.01


def test_the_finger_never_ends_inside_the_object():
    made = model(TEE, ellipsoid(C), friction=0.1)
    rng = np.random.default_rng(3)
    angles, aims = rng.uniform(0, 2 * np.pi, 60), rng.uniform(-0.4, 0.4, 60)
    starts = 0.12 * np.stack([np.cos(angles), np.sin(angles)], -1)
    directions = -(rotation(aims) @ starts[..., None])[..., 0] / 0.12
    poses, fingers = made.outcomes(starts, directions, np.full(60, 0.15))
    known = np.isfinite(poses[:, 0])
    assert known.sum() > 30
    v = TEE.vertices - made.origin
    for finger in fingers[known]:
        along = np.roll(v, -1, axis=0) - v
        share = np.clip(((finger - v) * along).sum(1) / (along**2).sum(1), 0, 1)
        gap = np.linalg.norm(v + share[:, None] * along - finger, axis=1).min()
        assert gap > RADIUS - 1e-5


def test_two_contacts_at_once_have_no_outcome():
    """Into the corner between the T's bar and its stem."""
    made = model(TEE, ellipsoid(C))
    corner = np.array([0.01, 0.01]) - made.origin
    start = corner + np.array([0.04, -0.04])
    pose, finger = pushed(made, start, [-1, 1], 0.06)
    assert np.isnan(pose).all()
    assert np.isnan(finger).all()
