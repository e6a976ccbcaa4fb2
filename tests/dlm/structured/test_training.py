from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from matplotlib.figure import Figure

from dlm.policy import Loss, PolicyKind
from dlm.simulator import SimulatorSettings
from dlm.structured.bias import STATED
from dlm.structured.examples import Example
from dlm.structured.losses import CalibrationLoss, CheckedClassLoss, ClassLoss, class_distance
from dlm.structured.policies import StructuredArchitecture
from dlm.structured.scorer import stack
from dlm.structured.weights import SHIPPED, strip, trained_model
from dlm.tasks import TaskBatch
from dlm.thesis.losses import ActionLoss, ParameterLoss, SimulationLoss
from dlm.training.checkpoint import load
from dlm.training.loop import Record, Row, Training, Watch, fit
from dlm.training.stage import Schedule, Stage
from expert.errors import InvalidProblem

SMALL = StructuredArchitecture(width=16, layers=1, heads=2)
QUIET = Watch(measure=lambda policy: {}, picture=lambda policy: Figure(figsize=(1, 1)))


def train(
    tasks: TaskBatch,
    path: Path,
    loss: Loss,
    *,
    kind: PolicyKind = "proposals",
    resume: bool = False,
    **schedule: float,
) -> list[Row]:
    """History of a short training, with a checkpoint at `path`."""
    stage = Stage(name=path.stem, policy=kind, loss=loss, dataset="train")
    plan = Schedule(
        **{
            "iterations": 6,
            "batch_size": 2,
            "save_every": 1,
            "log_every": 1,
            "learning_rate": 3e-3,
            **schedule,
        }
    )
    training = Training(SMALL.build(kind, seed=1), loss, tasks, plan)
    record = Record(path=path, stage=stage, model="structured", settings={})
    fit(training, record, watch=QUIET, resume=resume)
    return training.history


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


def test_the_scorer_learns_four_tasks_by_heart(tasks: TaskBatch, tmp_path: Path) -> None:
    history = train(
        tasks,
        tmp_path / "mdr.safetensors",
        ClassLoss(splitting=False, mirroring=False),
        iterations=60,
        batch_size=4,
    )
    assert history[-1]["loss"] < 0.1 * history[0]["loss"]


def test_the_regressor_learns(tasks: TaskBatch, tmp_path: Path) -> None:
    history = train(
        tasks, tmp_path / "nn.safetensors", ActionLoss(), kind="regressor", iterations=20, batch_size=4
    )
    assert history[-1]["loss"] < 0.7 * history[0]["loss"]


def test_logits_follow_the_facets_wherever_the_outline_begins(tasks: TaskBatch) -> None:
    scorer = SMALL.proposer().scorer
    vertices, poses = tasks.samples[0].task.body.vertices, tasks.samples[0].task.trajectory.poses
    count = len(vertices)
    logits = scorer(stack([(vertices, poses)]))[0]
    rolled = scorer(stack([(np.roll(vertices, -1, axis=0), poses)]))[0]
    turned = np.roll(np.arange(count), -1)
    asymmetric = torch.from_numpy(~scorer.schedules.symmetric & ~scorer.schedules.single)
    torch.testing.assert_close(
        rolled[asymmetric], logits[asymmetric][:, turned][:, :, turned], atol=1e-4, rtol=1e-4
    )
    moved = scorer(stack([(vertices, poses + [0.3, 0.0, 0.0])]))[0]
    torch.testing.assert_close(moved, logits, atol=1e-4, rtol=1e-4)


def test_padding_changes_no_logit(tasks: TaskBatch) -> None:
    scorer = SMALL.proposer().scorer
    both = [(s.task.body.vertices, s.task.trajectory.poses) for s in tasks.samples]
    wide = Example.of(tasks.samples[0]).split(np.random.default_rng(0), 12)
    batch = scorer(stack([*both, (wide.vertices, wide.poses)]))
    for k, one in enumerate(both):
        alone = scorer(stack([one]))[0]
        torch.testing.assert_close(batch[k][:, : len(one[0]), : len(one[0])], alone, atol=1e-4, rtol=1e-4)


def test_gradients_of_the_class_loss_agree_with_differences(tasks: TaskBatch) -> None:
    examples = [Example.of(s) for s in tasks.samples]
    scorer = SMALL.proposer().scorer
    weight = scorer.pair[-1].bias
    (gradient,) = torch.autograd.grad(class_distance(scorer, examples), weight)
    for k in (0, 3):
        ends = []
        for sign in (1, -1):
            with torch.no_grad():
                weight[k] += sign * 1e-2
                ends.append(float(class_distance(scorer, examples)))
                weight[k] -= sign * 1e-2
        assert (ends[0] - ends[1]) / 2e-2 == pytest.approx(float(gradient[k]), abs=1e-3)


def test_the_calibration_s_gradient_points_away_from_the_bias(tasks: TaskBatch) -> None:
    policy = StructuredArchitecture().proposer()
    few = tasks[torch.arange(2)]
    with torch.no_grad():
        policy.knobs[0] = 4.0  # the camera is taken to be 4 mm to the right of where it is
    loss = CalibrationLoss(simulator=SimulatorSettings())
    value = loss(policy, few)
    value.backward()
    assert policy.knobs.grad is not None
    assert float(value.detach()) > 10 * loss.at(policy, few, np.zeros(len(policy.knobs)))
    assert float(policy.knobs.grad[0]) > 0


def test_without_bias_calibration_leaves_everything_as_it_is(tasks: TaskBatch) -> None:
    policy = StructuredArchitecture().proposer()
    loss = CalibrationLoss(simulator=SimulatorSettings())(policy, tasks[torch.arange(2)])
    loss.backward()
    assert float(loss.detach()) < 1e-3
    assert policy.knobs.grad is not None
    assert not policy.knobs.grad.any()


def test_losses_refuse_policies_that_they_do_not_fit(tasks: TaskBatch) -> None:
    with pytest.raises(InvalidProblem, match="proposes contact classes"):
        ClassLoss()(SMALL.regressor(), tasks)
    with pytest.raises(InvalidProblem, match="derenders"):
        ParameterLoss()(SMALL.proposer(), tasks)
    with pytest.raises(InvalidProblem, match=r"stage\.policy"):
        SMALL.build("program")
    with pytest.raises(InvalidProblem, match=r"model\.widths"):
        replace(SMALL, widths=(8, 8))


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
