import numpy as np
import pytest

from dlm.evaluation.outcomes import execute
from dlm.execution import expert_action, idle_action
from dlm.tasks import TaskBatch
from tests.support.outcomes import RIGID, outcome


def test_the_expert_succeeds_and_idle_fingers_do_not(tasks: TaskBatch) -> None:
    expert, idle = (execute(f(tasks), tasks, RIGID) for f in (expert_action, idle_action))
    assert expert.success.all()
    assert not expert.dropped.any()
    assert not idle.success.any()
    first = idle.desired[:, :1].repeat(idle.desired.shape[1], axis=1)
    np.testing.assert_allclose(
        idle.poses, first, atol=1e-3
    )  # an object that nobody touches stays where it is


@pytest.mark.parametrize(
    ("shift", "success", "dropped"),
    [
        ({}, True, False),
        ({"x": 0.0019}, True, False),
        ({"x": 0.0021}, False, False),
        ({"theta": np.deg2rad(1.9)}, True, False),
        ({"theta": np.deg2rad(-2.1)}, False, False),
        ({"theta": 2 * np.pi}, True, False),
        ({"y": -0.0049}, False, False),
        ({"y": -0.0051}, False, True),
        ({"y": +0.0200}, False, False),
    ],
)
def test_success_and_drops_are_judged_at_the_end(
    tasks: TaskBatch, shift: dict[str, float], success: bool, dropped: bool
) -> None:
    moved = outcome(tasks, **shift)
    assert (moved.success == success).all()
    assert (moved.dropped == dropped).all()


def test_loss_and_rms_of_a_known_error(tasks: TaskBatch) -> None:
    moved = outcome(tasks, x=0.03)
    np.testing.assert_allclose(moved.object_loss, 3.0**2 / 15)
    rms_mm, rms_deg = moved.rms
    assert rms_mm == pytest.approx(30 / np.sqrt(5))
    assert rms_deg == pytest.approx(0, abs=1e-9)
