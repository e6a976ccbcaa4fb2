from pathlib import Path

import pytest
import torch

from dlm.evaluation.outcomes import act, execute
from dlm.policy import Loss, PolicyKind
from dlm.simulator import SimulatorSettings
from dlm.structured.bias import STATED
from dlm.structured.losses import CalibrationLoss, CheckedClassLoss, ClassLoss
from dlm.structured.policies import StructuredArchitecture
from dlm.tasks import TaskBatch
from dlm.thesis.losses import ActionLoss, SimulationLoss
from dlm.training.checkpoint import load
from tests.support.structured import train


def test_from_video_to_motion(tasks: TaskBatch) -> None:
    policy = StructuredArchitecture().proposer("proposals")
    outcome = execute(act(policy, tasks), tasks, SimulatorSettings())
    assert outcome.solved.all()
    assert outcome.success.all()
    assert outcome.object_loss.max() < 5e-3


SMOOTH = SimulatorSettings(kappa=1250.0)


STAGES: dict[str, tuple[PolicyKind, Loss]] = {
    "nn": ("regressor", ActionLoss()),
    "nnm": ("regressor", SimulationLoss(simulator=SMOOTH)),
    "mdr": ("best_guess", ClassLoss()),
    "cvx": ("proposals", CheckedClassLoss()),
    "dlm": ("proposals", CalibrationLoss(simulator=SMOOTH, bias=STATED)),
}


@pytest.mark.parametrize("stage", STAGES)
def test_a_stopped_training_reaches_the_same_losses(tasks: TaskBatch, tmp_path: Path, stage: str) -> None:
    kind, loss = STAGES[stage]
    length = 6
    if stage == "dlm":  # whose every step looks at fifteen calibrations
        length, tasks = 2, tasks[torch.arange(2)]
    whole = train(tasks, tmp_path / "whole.safetensors", loss, kind=kind, iterations=length)
    train(tasks, tmp_path / "cut.safetensors", loss, kind=kind, iterations=length // 2)
    assert (
        train(tasks, tmp_path / "cut.safetensors", loss, kind=kind, iterations=length, resume=True) == whole
    )
    ends = [load(tmp_path / f"{name}.safetensors", command="").model for name in ("whole", "cut")]
    assert all(torch.equal(ends[0][key], ends[1][key]) for key in ends[0])
    assert len({row["loss"] for row in whole}) == length  # it did learn something


def test_the_regressor_learns(tasks: TaskBatch, tmp_path: Path) -> None:
    history = train(
        tasks, tmp_path / "nn.safetensors", ActionLoss(), kind="regressor", iterations=20, batch_size=4
    )
    assert history[-1]["loss"] < 0.7 * history[0]["loss"]
