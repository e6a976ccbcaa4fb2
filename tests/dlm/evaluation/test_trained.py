from pathlib import Path
from typing import Any

import pytest
import torch

from dlm.evaluation.trained import read_trained, title_of
from dlm.inverse_dynamics.layer import InverseDynamics
from dlm.inverse_dynamics.parameters import Layout
from dlm.tasks import TaskBatch
from dlm.thesis.derender import NetworkSizes
from dlm.thesis.losses import ActionLoss
from dlm.thesis.policies import ThesisArchitecture
from dlm.training.loop import Record, Training
from dlm.training.orchestrate import checkpoint_path, seed_folder
from dlm.training.stage import Schedule, Stage
from expert.errors import InvalidProblem

SMALL = NetworkSizes(channels=(2, 3, 4), latent=8, recurrent_layers=1, hidden_layers=1)
STAGE = Stage(name="nn", policy="perceptron", loss=ActionLoss(), dataset="train")
MODEL = ThesisArchitecture(sizes=SMALL, layout=Layout())
MADE: dict[str, Any] = {"the stage": STAGE, "the model": MODEL, "the solver": InverseDynamics()}
"""What stands for Hydra here: objects by the plain values that describe them."""


def saved(tasks: TaskBatch, output: Path, seed: int, name: str = "nn") -> dict[str, torch.Tensor]:
    """A checkpoint after one iteration; its weights."""
    policy = MODEL.build("perceptron", InverseDynamics(), seed=seed)
    training = Training(policy, STAGE.loss, tasks, Schedule(batch_size=4))
    training.iterate()
    settings = {"stage": "the stage", "model": "the model", "solver": "the solver"}
    path = checkpoint_path(seed_folder(output, seed), name)
    record = Record(path=path, stage=STAGE, model="thesis", settings=settings)
    training.checkpoint(record).save(path)
    return {name: value.clone() for name, value in policy.weights().items()}


def test_policies_come_back_with_their_weights_and_records(tasks: TaskBatch, tmp_path: Path) -> None:
    weights = [saved(tasks, tmp_path, seed) for seed in (1, 2)]
    found = read_trained(tmp_path, "nn", [1, 2], MADE.__getitem__)
    assert found.title == "NN"
    assert [about.iteration for about in found.abouts] == [1, 1]
    for policy, before in zip(found.policies, weights, strict=True):
        assert all(torch.equal(before[name], value) for name, value in policy.weights().items())


def test_settling_takes_the_statistics_of_batch_norm_anew(tasks: TaskBatch, tmp_path: Path) -> None:
    saved(tasks, tmp_path, 1)
    plain = read_trained(tmp_path, "nn", [1], MADE.__getitem__)
    (policy,) = read_trained(tmp_path, "nn", [1], MADE.__getitem__).settled({"train": tasks}).policies
    assert any(
        not torch.equal(value, policy.weights()[name]) for name, value in plain.policies[0].weights().items()
    )


def test_a_checkpoint_of_another_stage_or_none_is_refused(tasks: TaskBatch, tmp_path: Path) -> None:
    saved(tasks, tmp_path, 1, name="mdr")
    with pytest.raises(InvalidProblem, match=r"mdr\.safetensors: expected stage mdr, got stage nn"):
        read_trained(tmp_path, "mdr", [1], MADE.__getitem__)
    with pytest.raises(InvalidProblem, match=r"python train\.py stage=nn seed=1"):
        read_trained(tmp_path, "nn", [1], MADE.__getitem__)


def test_variants_of_a_stage_are_told_apart_in_words() -> None:
    assert [title_of(name) for name in ("nn", "cvx_longer")] == ["NN", "CVX longer"]
