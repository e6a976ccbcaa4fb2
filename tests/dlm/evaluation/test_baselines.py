from dataclasses import replace

import pytest
import torch

from dlm.evaluation.baselines import unlearned
from dlm.evaluation.outcomes import execute
from dlm.execution import AWAY
from dlm.tasks import TaskBatch
from tests.support.outcomes import RIGID


@pytest.mark.parametrize("title", unlearned())
def test_perceived_geometry_is_planned_for_without_learning(tasks: TaskBatch, title: str) -> None:
    outcome = execute(unlearned()[title](tasks), tasks, RIGID)
    assert outcome.solved.all()
    assert outcome.success.all()


def test_where_nothing_is_seen_fingers_are_idle(tasks: TaskBatch) -> None:
    blank = torch.full_like(tasks.video, 240)
    samples = tuple(replace(s, video=v.numpy()) for s, v in zip(tasks.samples, blank, strict=True))
    action = unlearned()["no learning"](replace(tasks, video=blank, samples=samples))
    assert not action.solved.any()
    assert (action.positions[..., 1] == AWAY).all()
    assert not action.forces.any()
