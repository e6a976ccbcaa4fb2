"""The execution layer: where fingers are told to go."""

import numpy as np
import pytest

from dlm.simulator import Execution, SimulatorSettings
from dlm.simulator.replay import planned_commands
from expert.geometry.pose import rotation, to_world
from tests.support.scenes import MASS, WEIGHT, T, lift, push, random_case, scene

STIFFNESS = 1e5 * MASS


@pytest.mark.parametrize("rolling", [True, False])
def test_a_loaded_finger_rides_on_its_point_and_leads_by_its_force(rolling):
    case = lift()
    settings = SimulatorSettings(execution=Execution(rolling=rolling))
    commands, first = planned_commands(case.scene, case.positions, case.forces, settings)
    outward = np.array([[-1, 0], [1, 0]])
    standing = case.positions + settings.finger_radius * outward
    np.testing.assert_allclose(first, standing[0], atol=1e-15)
    np.testing.assert_allclose(commands[::20], standing + case.forces / STIFFNESS, atol=1e-15)


def test_an_idle_finger_is_parked_off_the_object():
    case = push()
    positions = case.positions.copy()
    positions[:, 1] = case.scene.trajectory.poses[:, :2] + [0.0, 0.0201]  # just above the top facet
    commands, _ = planned_commands(case.scene, positions, case.forces, SimulatorSettings())
    assert commands[:, 1, 1] == pytest.approx(0.04 + 0.005 + SimulatorSettings().finger_radius)
    left = SimulatorSettings(execution=Execution(parking=0))
    near, _ = planned_commands(case.scene, positions, case.forces, left)
    assert near[:, 1, 1] == pytest.approx(0.0401 + left.finger_radius)


def test_forces_ramp_up_before_the_first_loaded_knot_and_down_after_the_last():
    case = push(0.0)
    forces = np.zeros_like(case.forces)
    forces[2, 0, 0] = WEIGHT  # loaded in the interval from knot 2 to knot 3 alone
    commands, _ = planned_commands(case.scene, case.positions, forces, SimulatorSettings())
    ahead = (
        (commands[:, 0, 0] - case.positions[0, 0, 0] + SimulatorSettings().finger_radius) * STIFFNESS / WEIGHT
    )
    np.testing.assert_allclose(ahead[40:60], 1, atol=1e-9)  # held through the interval
    np.testing.assert_allclose(ahead[32:41], np.linspace(0, 1, 9), atol=1e-9)  # 40 % early
    np.testing.assert_allclose(ahead[60:69], np.linspace(1, 0, 9), atol=1e-9)  # 40 % late
    assert ahead[20:31].max() < -1  # away before
    off = SimulatorSettings(execution=Execution(approach=0, release=0, lift_off=0, parking=0))
    abrupt, _ = planned_commands(case.scene, case.positions, forces, off)
    assert (abrupt[:40, 0, 0] < case.positions[0, 0, 0]).all()


def test_compensation_and_material_points_can_be_switched_off():
    case = random_case(np.random.default_rng(0))
    plain = SimulatorSettings(execution=Execution(compensation=False))
    a, _ = planned_commands(case.scene, case.positions, case.forces, plain)
    b, _ = planned_commands(case.scene, case.positions, 2 * case.forces, plain)
    np.testing.assert_array_equal(a, b)
    straight = SimulatorSettings(execution=Execution(compensation=False, material_point=False, rolling=False))
    c, _ = planned_commands(case.scene, case.positions, case.forces, straight)
    middle = 0.5 * (c[20] + c[40])
    np.testing.assert_allclose(c[30], middle, atol=1e-12)
    assert np.abs(a[30] - 0.5 * (a[20] + a[40])).max() > 1e-6


def test_a_round_finger_rolls_without_slip():
    """A finger of 2 mm on a turning object: with the correction the contact point stays on its material point."""
    case = lift()
    turned = case.scene.trajectory.poses.copy()
    turned[:, 2] = np.linspace(0, 0.3, T)
    s = scene(case.scene.body, turned)
    body = np.array([[-0.03, 0.0], [0.03, 0.0]])
    positions = to_world(turned, body)
    forces = np.einsum("tij,tcj->tci", rotation(turned[:, 2]), 0 * case.forces + [[3, 0], [-3, 0]])
    slips = []
    for rolling in (True, False):
        settings = SimulatorSettings(finger_radius=2e-3, execution=Execution(rolling=rolling))
        commands, _ = planned_commands(s, positions, forces, settings)
        centre = rotation(-turned[-1, 2]) @ (commands[-1] - turned[-1, :2] - forces[-1] / STIFFNESS).T
        slips.append(abs(centre.T[0, 1] - body[0, 1]))
    assert slips[1] < 1e-12
    assert slips[0] == pytest.approx(2e-3 * 0.3, rel=1e-9)
