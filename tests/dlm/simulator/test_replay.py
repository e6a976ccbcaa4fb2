"""One recorded execution."""

import numpy as np
import pytest

from dlm.simulator import SimulatorSettings, replay
from expert.errors import InvalidProblem
from tests.support.scenes import WEIGHT, lift, push


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


def test_recorded_contact_forces_move_the_object():
    """Impulses of all contacts and of gravity add up to the change of momentum, step by step."""
    case = lift()
    r = replay(case.scene, case.positions, case.forces)
    h = case.scene.trajectory.dt / SimulatorSettings().substeps
    force = np.zeros((len(r.work), 2))
    np.add.at(force, r.contacts.step, r.contacts.force)
    change = case.scene.body.mass * np.diff(r.substep_velocities[:, :2], axis=0) / h
    np.testing.assert_allclose(force - [0, WEIGHT], change, atol=1e-9)


def test_the_loss_and_the_last_error_are_those_of_the_recorded_poses():
    case = push()
    r = replay(case.scene, case.positions + [0.001, 0], case.forces)  # 1 mm ahead of the plan
    assert r.final_error[0] == pytest.approx(1, rel=0.1)
    assert r.loss == pytest.approx(
        ((100 * (r.poses - case.scene.trajectory.poses)[:, 0]) ** 2).mean() / 3, rel=0.01
    )
