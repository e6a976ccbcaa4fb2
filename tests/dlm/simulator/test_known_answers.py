"""Mechanics with answers in closed form: when a pushed block tips, a squeezed wedge holds, a drawer jams, a block rests."""

import numpy as np
import pytest

from dlm.simulator import Scene
from expert.geometry.pose import Array
from expert.world.environment import Environment
from expert.world.motion import Trajectory
from expert.world.shape import Body
from expert.world.walls import HalfPlane
from tests.support.scenes import MASS, WEIGHT
from tests.support.steps import driven

RADIUS, H = 1e-4, 0.005
UP = np.array([0.0, 1.0])


def scene(
    vertices: Array, pose: Array, walls: tuple[HalfPlane, ...], friction: float, gravity: float = 9.81
) -> Scene:
    body, _ = Body.uniform(vertices, MASS)
    where = Environment(walls=walls, gravity=gravity)
    still = Trajectory.of(np.tile(pose, (3, 1)), 20 * H, "rest")
    return Scene(body=body, environment=where, trajectory=still, friction=friction)


def box(width: float, height: float) -> Array:
    return np.array([[0, 0], [width, 0], [width, height], [0, height]])


def eased(distance: float, steps: int) -> Array:
    """Positions (steps + 1,) with constant acceleration from rest."""
    return distance * np.linspace(0, 1, steps + 1) ** 2


def turn_when_pushed(height: float, width: float, mu: float, finger_mu: float) -> float:
    """Angle of a block that a finger at that height pushed by a millimetre."""
    tall = 1.5 * height
    floor = HalfPlane(point=np.zeros(2), normal=UP, friction=mu)
    pose = np.array([width / 2, tall / 2, 0.0])
    s = scene(box(width, tall), pose, (floor,), finger_mu)
    commands = np.zeros((401, 1, 2))
    commands[:, 0, 0], commands[:, 0, 1] = -RADIUS + eased(1e-3, 400), height
    return float(driven(s, pose, commands, commands[0]).substep_poses[-1, 2])


@pytest.mark.parametrize(("mu", "finger_mu"), [(0.5, 0.2), (0.4, 0.0), (0.3, 0.5)])
def test_a_pushed_block_tips_above_a_height_and_slides_below(mu, finger_mu):
    """Moments about the leading corner, the back face rising along the finger: N z = m g w / 2 + muf N w."""
    width = 0.04
    height = width * (1 - mu * finger_mu) / (2 * mu) + width * finger_mu
    assert (
        abs(turn_when_pushed(0.998 * height, width, mu, finger_mu)) < 1e-3
    )  # the finger's spring gives first
    assert turn_when_pushed(1.002 * height, width, mu, finger_mu) < -1e-2


def drop_of_a_wedge(force: float, angle: float, mu: float) -> float:
    """How far a trapezoid, wider below, falls in 0.1 s between two fingers with that normal force each."""
    tall, top = 0.04, 0.03
    bottom = top + 2 * tall * np.tan(angle)
    vertices = np.array([[-bottom / 2, 0], [bottom / 2, 0], [top / 2, tall], [-top / 2, tall]])
    centroid = Body.uniform(vertices, MASS)[1]
    pose = np.array([0.0, 0.0, 0.0])
    s = scene(vertices, pose, (), mu)
    half = bottom / 2 - centroid[1] * np.tan(angle)
    friction = (WEIGHT / 2 + force * np.sin(angle)) / np.cos(angle)  # what holds the wedge up, if mu allows
    fingers, commands = np.zeros((2, 2)), np.zeros((21, 2, 2))
    for c, side in enumerate((-1, 1)):
        out, along = (
            np.array([side * np.cos(angle), np.sin(angle)]),
            np.array([-side * np.sin(angle), np.cos(angle)]),
        )
        fingers[c] = [side * half, 0] + RADIUS * out
        commands[:, c] = fingers[c] + (friction * along - force * out) / s.stiffness
    record = driven(
        s, pose, commands, fingers, regularization=1e-6
    )  # by default contacts give by some 0.05 %
    return float(-record.substep_poses[-1, 1])


@pytest.mark.parametrize(("angle", "mu"), [(0.0, 0.4), (0.1, 0.5), (0.3, 0.6)])
def test_a_squeezed_wedge_holds_above_a_force_and_slips_below(angle, mu):
    """2 N (mu cos a - sin a) = m g."""
    force = WEIGHT / (2 * (mu * np.cos(angle) - np.sin(angle)))
    assert abs(drop_of_a_wedge(1.001 * force, angle, mu)) < 5e-6
    assert drop_of_a_wedge(0.999 * force, angle, mu) > 3e-5


def advance_of_a_drawer(mu: float, length: float, eccentricity: float) -> float:
    """How far a drawer of that length goes in its guide, pushed off its middle by 2 mm."""
    width, clearance = 3 * eccentricity, 1e-5
    guide = (
        HalfPlane(point=np.zeros(2), normal=UP, friction=mu),
        HalfPlane(point=np.array([0, width + clearance]), normal=-UP, friction=mu),
    )
    pose = np.array([length / 2, width / 2 + clearance / 2, 0.0])
    s = scene(box(length, width), pose, guide, friction=0.0, gravity=1e-9)
    commands = np.zeros((401, 1, 2))
    commands[:, 0, 0], commands[:, 0, 1] = -RADIUS + eased(2e-3, 400), pose[1] + eccentricity
    record = driven(s, pose, commands, commands[0])
    return float(record.substep_poses[-1, 0] - pose[0])


@pytest.mark.parametrize(("length", "eccentricity"), [(0.06, 0.04), (0.06, 0.02)])
def test_a_drawer_jams_where_friction_exceeds_half_its_length_over_the_eccentricity(length, eccentricity):
    mu = length / (2 * eccentricity)
    assert advance_of_a_drawer(0.97 * mu, length, eccentricity) > 1.8e-3
    assert advance_of_a_drawer(1.03 * mu, length, eccentricity) < 0.3e-3


def test_a_block_rests_on_a_slope_however_its_edge_is_cut():
    """40 x 80 mm at 26 deg with mu = 0.63: it neither slips (tan 26 deg = 0.49) nor tips (w / h = 0.5)."""
    angle = np.radians(26)
    normal = np.array([np.sin(angle), np.cos(angle)])
    slope = HalfPlane(point=np.zeros(2), normal=normal, friction=0.63)
    pose = np.array([*(0.04 * normal), -angle])
    cut = np.column_stack([np.linspace(0, 0.04, 12), np.zeros(12)])
    far = np.full((201, 1, 2), 9.0)
    for vertices in (box(0.04, 0.08), np.vstack([cut, [[0.04, 0.08], [0, 0.08]]])):
        record = driven(scene(vertices, pose, (slope,), 0.5), pose, far, far[0])
        assert np.abs(record.substep_poses - pose).max() < 2e-5


@pytest.mark.parametrize("way", [-1, 1])
def test_a_box_sliding_on_its_corner_stays_out_of_the_floor(way):
    """100 mm, 10 deg, 1 m/s, mu = 1.5, where sweeps and Newton's method find no impulses."""
    angle = np.radians(10)
    floor = HalfPlane(point=np.zeros(2), normal=UP, friction=1.5)
    low = 0.05 * (np.sin(angle) + np.cos(angle))
    pose = np.array([0.0, low, angle])
    far = np.full((21, 1, 2), 9.0)
    s = scene(box(0.1, 0.1), pose, (floor,), 0.5)
    record = driven(s, pose, far, far[0], velocity=np.array([way, 0.0, 0.0]))
    assert record.contacts.gap.min() > -1e-4
    assert record.cone_residual < 1e-7 * WEIGHT
    assert np.diff(record.energy).max() <= 1e-4 * WEIGHT * 0.1
