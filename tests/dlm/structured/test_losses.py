from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from datasets.specification import Sample
from dlm.simulator import SimulatorSettings
from dlm.structured.classes import Schedules
from dlm.structured.examples import Example
from dlm.structured.losses import (
    MOST_REGRET,
    CalibrationLoss,
    ClassLoss,
    class_distance,
    regrets,
)
from dlm.structured.policies import StructuredArchitecture
from dlm.tasks import TaskBatch
from dlm.thesis.losses import ParameterLoss
from expert.errors import InvalidProblem
from tests.support.structured import SMALL, train


def test_the_scorer_learns_four_tasks_by_heart(tasks: TaskBatch, tmp_path: Path) -> None:
    history = train(
        tasks,
        tmp_path / "mdr.safetensors",
        ClassLoss(splitting=False, mirroring=False),
        iterations=60,
        batch_size=4,
    )
    assert history[-1]["loss"] < 0.1 * history[0]["loss"]


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
    policy = StructuredArchitecture().build("proposals", seed=0)
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
    policy = StructuredArchitecture().build("proposals", seed=0)
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


SCHEDULES = Schedules()


@pytest.fixture(params=range(4))
def sample(request: pytest.FixtureRequest, tasks: TaskBatch) -> Sample:
    return tasks.samples[request.param]


def test_regrets_vanish_at_the_expert_s_class_and_never_beat_it(sample: Sample) -> None:
    values = regrets(sample, SCHEDULES)
    classes = SCHEDULES.classes(len(sample.task.body.vertices)).tolist()
    own = classes.index(list(SCHEDULES.class_of(sample.plan.modes) or ()))
    assert values[own] == pytest.approx(0.0, abs=2e-2)
    assert ((values >= 0) & (values <= MOST_REGRET)).all()
    assert values.max() == MOST_REGRET
