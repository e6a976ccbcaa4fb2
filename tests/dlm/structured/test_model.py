from dataclasses import replace

import numpy as np
import pytest
import torch

from datasets.motions import TaskSettings
from dlm.structured import Planning, StructuredModel
from dlm.structured.policies import StructuredArchitecture
from dlm.tasks import TaskBatch
from expert.errors import InvalidProblem
from tests.support.structured import seen_by_label


def test_parameters_of_a_plan_are_those_of_4_ct4(tasks: TaskBatch) -> None:
    planned = StructuredModel().plan(seen_by_label(tasks, 0))
    assert planned.status == "planned"
    assert planned.parameters is not None
    np.testing.assert_array_equal(planned.parameters.reference_positions, planned.plan.positions)
    assert planned.action().solved.tolist() == [True]


def test_what_cannot_be_done_is_said_and_not_planned(tasks: TaskBatch) -> None:
    weak = TaskSettings(facet_margin=0.2, force_limit=0.1)
    k = next(i for i, s in enumerate(tasks.samples) if "lift" in s.family)
    planned = StructuredModel(planning=Planning(tasks=weak)).plan(seen_by_label(tasks, k))
    assert planned.status == "no_plan"
    assert "no plan among" in planned.reason
    assert planned.plan is None
    assert planned.parameters is None
    assert planned.action().solved.tolist() == [False]


def test_a_doubtful_fit_keeps_its_doubts(tasks: TaskBatch) -> None:
    doubtful = replace(seen_by_label(tasks, 0), status="poor_fit", reason="something is in front")
    planned = StructuredModel().plan(doubtful)
    assert (planned.status, planned.reason) == ("poor_fit", "something is in front")
    assert planned.plan is not None


def test_geometry_that_makes_no_object_has_no_plan(tasks: TaskBatch) -> None:
    crossing = np.array([[0, 0], [0.05, 0.05], [0.05, 0], [0, 0.05]]) - 0.025
    planned = StructuredModel().plan(replace(seen_by_label(tasks, 0), vertices=crossing))
    assert planned.status == "no_plan"
    assert "simple polygon" in planned.reason


def test_an_empty_video_is_an_error_for_users_and_unsolved_for_training(tasks: TaskBatch) -> None:
    nothing = np.full_like(tasks.samples[0].video, 240)
    with pytest.raises(InvalidProblem, match="video"):
        StructuredModel().act(nothing)
    action = StructuredArchitecture().proposer("proposals")(torch.from_numpy(nothing)[None])
    assert action.solved.tolist() == [False]
