"""The execution layer: where fingers are told to go."""

import numpy as np
import pytest

from dlm.simulator import Execution, SceneBatch, SimulatorSettings, replay
from dlm.simulator.contact import view
from dlm.simulator.execution import command, desired_motion, plan_commands, pull_back
from dlm.simulator.replay import planned_commands
from expert.errors import InvalidProblem
from expert.geometry.pose import rotation, to_world
from tests.support.scenes import MASS, WEIGHT, T, lift, push, random_case, scene

STIFFNESS = 1e5 * MASS


def motion_of(path, **execution):
    settings = SimulatorSettings(execution=Execution(**execution))
    return desired_motion(np.asarray(path, dtype=float), 0.1, 0.03, settings.layers)


def test_the_path_meets_its_knots_and_starts_and_ends_at_rest():
    path = np.cumsum(np.random.default_rng(0).normal(0, [0.01, 0.01, 0.2], (T, 3)), axis=0)
    motion = motion_of(path)
    np.testing.assert_allclose(motion[::20], path, atol=1e-15)
    steps = np.linalg.norm(np.diff(motion, axis=0), axis=1)
    assert steps[0] < 0.15 * steps[:20].max()
    assert steps[-1] < 0.15 * steps[-20:].max()


def test_a_pivot_keeps_its_vertex_still_between_the_knots():
    vertex, angles = np.array([-0.03, -0.02]), np.array([0, 0.1, 0.3, 0.5, 0.55])
    path = np.column_stack([-np.stack([rotation(a) @ vertex for a in angles]), angles])
    corner = to_world(motion_of(path), vertex[None])[:, 0]
    assert np.abs(corner - corner[0]).max() < 1e-15


def test_timing_is_monotone_and_stops_in_sharp_corners():
    path = np.array([[0, 0, 0], [0.01, 0, 0], [0.02, 0, 0], [0.02, 0.01, 0], [0.02, 0.02, 0]])
    motion = motion_of(path)
    assert (np.diff(motion[:, :2], axis=0) >= -1e-15).all()
    speed = np.linalg.norm(np.diff(motion[:, :2], axis=0), axis=1)
    assert speed[39:41].max() < 0.2 * speed.max()
    assert np.linalg.norm(np.diff(motion_of(path, timing="linear"), axis=0), axis=1) == pytest.approx(
        0.01 / 20
    )


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


@pytest.mark.parametrize("seed", range(6))
def test_pull_back_is_the_transpose_of_the_derivative(seed):
    rng = np.random.default_rng(seed)
    case = random_case(rng)
    loaded = rng.random((T, 2)) < 0.6
    batch, layers = SceneBatch.of([case.scene]), SimulatorSettings().layers
    scene, path = view(batch.arrays, 0), batch.desired[0]
    lifted = case.positions + 0.002 * rng.normal(size=case.positions.shape)

    def commands(positions, forces):
        table, out = plan_commands(scene, path, positions, loaded, layers), np.zeros((81, 2, 2))
        command(table, positions, forces, scene.stiffness, out)
        return out

    dp, df = 1e-7 * rng.normal(size=lifted.shape), 1e-3 * rng.normal(size=lifted.shape)
    change = (commands(lifted + dp, case.forces + df) - commands(lifted - dp, case.forces - df)) / 2
    adjoint = rng.normal(size=change.shape)
    d_positions, d_forces = np.zeros_like(lifted), np.zeros_like(lifted)
    table = plan_commands(scene, path, lifted, loaded, layers)
    pull_back(table, adjoint, scene.stiffness, d_positions, d_forces)
    assert (adjoint * change).sum() == pytest.approx(
        (d_positions * dp).sum() + (d_forces * df).sum(), rel=1e-5
    )


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


@pytest.mark.parametrize(
    ("field", "bad"),
    [("approach", 0.6), ("release", -0.1), ("lift_off", np.nan), ("parking", -1.0), ("timing", "cubic")],
)
def test_bad_execution_settings_are_refused_by_name(field, bad):
    with pytest.raises(InvalidProblem, match=f"execution.{field}"):
        Execution(**{field: bad})


@pytest.mark.parametrize(
    ("field", "bad"),
    [("substeps", 0), ("finger_radius", 0.0), ("kappa", np.nan), ("gradient", "magic"), ("damping", -1.0)],
)
def test_bad_simulator_settings_are_refused_by_name(field, bad):
    with pytest.raises(InvalidProblem, match=f"simulator.{field}"):
        SimulatorSettings(**{field: bad})


def test_plans_of_a_wrong_shape_or_with_nan_are_refused():
    case = push()
    with pytest.raises(InvalidProblem, match="positions"):
        replay(case.scene, case.positions[:3], case.forces[:3])
    with pytest.raises(InvalidProblem, match="forces"):
        replay(case.scene, case.positions, case.forces[:, :1])
    broken = case.forces.copy()
    broken[0, 0, 0] = np.nan
    with pytest.raises(InvalidProblem, match="forces: expected finite"):
        replay(case.scene, case.positions, broken)
