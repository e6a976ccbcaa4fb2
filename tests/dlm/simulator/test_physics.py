"""Laws that the time stepper must keep, on scenes with known answers and on random ones."""

from dataclasses import replace

import numpy as np
import pytest

from dlm.simulator import Scene, SimulatorSettings, replay
from expert.world.environment import Environment
from expert.world.motion import Trajectory
from expert.world.walls import HalfPlane
from tests.support.scenes import DT, MASS, WEIGHT, G, T, block, lift, push, random_case, scene
from tests.support.steps import driven

STEPS, SUBSTEPS = 40, 20


def drift(s: Scene, pose, velocity=None, steps=STEPS, **settings):
    """Motion without fingers in reach."""
    commands = np.full((steps + 1, 1, 2), 9.0)
    return driven(s, pose, commands, commands[0], velocity, **settings)


def on_slope(angle: float, friction: float) -> tuple[Scene, np.ndarray]:
    """A block at rest on a slope that falls to the right."""
    normal = np.array([np.sin(angle), np.cos(angle)])
    slope = HalfPlane(point=np.zeros(2), normal=normal, friction=friction, name="slope")
    pose = np.array([*(0.02 * normal), -angle])
    return scene(block(), np.tile(pose, (T, 1)), Environment(walls=(slope,))), pose


def test_free_fall():
    s = scene(block(), np.tile([0, 1.0, 0], (T, 1)))
    r = drift(s, [0, 1.0, 0.3], velocity=np.array([0.1, 0, 2.0]))
    t = STEPS * DT / SUBSTEPS
    np.testing.assert_allclose(r.substep_poses[-1], [0.1 * t, 1 - G * t * t / 2, 0.3 + 2 * t], atol=1e-12)
    assert np.ptp(r.energy) < 1e-12


def test_a_block_sticks_on_a_slope_below_the_friction_angle():
    s, pose = on_slope(0.3, 1.05 * np.tan(0.3))
    r = drift(s, pose)
    assert np.abs(r.substep_poses - pose).max() < 2e-5


def test_a_block_slides_down_a_slope_with_the_acceleration_of_coulomb():
    mu = 0.2
    s, pose = on_slope(0.3, mu)
    r = drift(s, pose)
    speed = r.substep_velocities[-1, :2] @ [np.cos(0.3), -np.sin(0.3)]
    expected = G * (np.sin(0.3) - mu * np.cos(0.3)) * STEPS * DT / SUBSTEPS
    assert speed == pytest.approx(expected, rel=1e-3)


def test_frictionless_mode_slides_on_any_slope():
    s, pose = on_slope(0.3, 5.0)
    r = drift(s, pose, frictionless=True)
    speed = np.linalg.norm(r.substep_velocities[-1, :2])
    assert speed == pytest.approx(G * np.sin(0.3) * STEPS * DT / SUBSTEPS, rel=1e-3)


def test_a_sliding_block_on_the_table_stops_after_the_distance_of_coulomb():
    """Every step loses mu g h of speed before it moves the block, so that it stops v h / 2 early."""
    mu, v, h = 0.3, 0.3, DT / SUBSTEPS
    table = Environment(plane="transverse", support_friction=mu)
    s = scene(block(), np.zeros((T, 3)), table)
    r = drift(s, [0, 0, 0], velocity=np.array([v, 0, 0]), steps=60)
    assert r.substep_poses[-1, 0] == pytest.approx(v * v / (2 * mu * G) - v * h / 2, rel=1e-3)
    assert np.abs(r.substep_velocities[-1]).max() < 1e-5


@pytest.mark.parametrize("seed", range(20))
def test_passive_scenes_never_gain_energy(seed):
    rng = np.random.default_rng(seed)
    s = random_case(rng).scene
    pose = s.trajectory.poses[0] + [0.02, 0.03, rng.uniform(-1, 1)]
    r = drift(s, pose, velocity=rng.normal(0, [0.3, 0.3, 5]), steps=100)
    assert np.diff(r.energy).max() <= 1e-4 * WEIGHT * s.body.size
    assert r.ok


@pytest.mark.parametrize("plane", ["sagittal", "transverse"])
def test_momentum_and_cones_hold_at_every_step(plane):
    rng = np.random.default_rng(5)
    for _ in range(40):
        c = random_case(rng, plane=plane)
        r = replay(c.scene, c.positions, c.forces)
        assert r.momentum_residual < 1e-9 * WEIGHT
        assert r.cone_residual < 1e-7 * WEIGHT


@pytest.mark.parametrize("case", [push(), lift()])
def test_hand_made_plans_follow_the_desired_motion(case):
    r = replay(case.scene, case.positions, case.forces)
    mm, deg = r.final_error
    assert mm < 0.05
    assert deg < 0.01
    assert r.loss < 1e-5


def test_the_fingers_work_pays_for_the_lift():
    case = lift()
    r = replay(case.scene, case.positions, case.forces)
    gained = r.energy[-1] - r.energy[0]
    assert gained == pytest.approx(WEIGHT * 0.03, rel=0.01)
    assert r.work.sum() == pytest.approx(gained, rel=0.01)


def test_contact_forces_of_the_lift_are_the_planned_ones():
    case = lift()
    r = replay(case.scene, case.positions, case.forces)
    late = r.contacts.step == 39  # half way: the force is that of the middle knot
    forces = r.contacts.force[late & (r.contacts.finger == 0)]
    np.testing.assert_allclose(forces[0], case.forces[2, 0], atol=0.05 * WEIGHT)


def test_halving_the_step_hardly_moves_the_end():
    for case in (push(), lift()):
        coarse = replay(case.scene, case.positions, case.forces)
        fine = replay(case.scene, case.positions, case.forces, SimulatorSettings(substeps=40))
        assert np.abs(coarse.poses[-1] - fine.poses[-1]).max() < 1e-4


def test_a_heavier_object_is_dropped():
    case = lift()
    heavy = replace(case.scene.body, mass=4 * MASS, inertia=4 * case.scene.body.inertia)
    r = replay(replace(case.scene, body=heavy), case.positions, case.forces)
    assert r.final_error[0] > 5


def test_the_scene_of_a_trajectory_at_rest_stays_at_rest():
    s = scene(block(), np.tile([0, 0.02, 0], (T, 1)))
    assert isinstance(s.trajectory, Trajectory)
    r = drift(s, [0, 0.02, 0])
    assert np.abs(r.substep_poses - [0, 0.02, 0]).max() < 1e-6
