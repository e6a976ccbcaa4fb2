from pathlib import Path

import numpy as np
import pytest

from dlm.structured.losses import ClassLoss
from dlm.structured.weights import SHIPPED, strip, trained_model
from dlm.tasks import TaskBatch
from dlm.training.checkpoint import load
from expert.errors import InvalidProblem
from tests.support.structured import train


def test_shipped_weights_are_small_and_carry_no_moments(tasks: TaskBatch, tmp_path: Path) -> None:
    assert SHIPPED.stat().st_size < 10e6
    saved = load(SHIPPED, command="")
    assert not saved.optimiser
    strip(SHIPPED, tmp_path / "again.safetensors")
    sample = tasks.samples[0]
    answers = [
        model.act(sample.video)
        for model in (trained_model(tmp_path / "again.safetensors"), trained_model(SHIPPED))
    ]
    np.testing.assert_array_equal(answers[0].plan.positions, answers[1].plan.positions)
    assert answers[0].checked <= 8


def test_weights_of_another_model_are_refused(tasks: TaskBatch, tmp_path: Path) -> None:
    train(tasks, tmp_path / "mdr.safetensors", ClassLoss(), iterations=1)
    with pytest.raises(InvalidProblem, match="of shape"):
        trained_model(tmp_path / "mdr.safetensors")  # of a smaller network
    with pytest.raises(InvalidProblem, match="no such file"):
        trained_model(tmp_path / "nothing.safetensors")
