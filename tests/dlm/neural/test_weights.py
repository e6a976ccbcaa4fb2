from pathlib import Path

import pytest
import torch

from dlm.evaluation.outcomes import act, execute
from dlm.infer.__main__ import chosen_model
from dlm.inverse_dynamics.layer import InverseDynamics
from dlm.neural import NeuralArchitecture
from dlm.neural.pointer import Pointer
from dlm.neural.weights import SHIPPED, shipped, trained
from dlm.simulator import SimulatorSettings
from dlm.structured.planners import ClassPlanner
from dlm.structured.policies import ProposalPolicy
from dlm.structured.weights import SHIPPED as STRUCTURED
from dlm.tasks import TaskBatch
from dlm.training.checkpoint import load, restore_weights
from expert.errors import InvalidProblem


def test_the_shipped_pointer_proposes_what_moves_the_object(tasks: TaskBatch) -> None:
    model = shipped()
    assert SHIPPED.stat().st_size < 2e6
    for k, sample in enumerate(tasks.samples):
        planned = model.act(sample.video)
        assert planned.plan is not None, k
        outcome = execute(planned.action(), tasks[torch.tensor([k])], SimulatorSettings())
        assert outcome.success.all(), k
        assert planned.checked <= 8, k  # the first batch of proposals was enough


def test_its_first_choice_through_the_program_moves_most_objects(tasks: TaskBatch) -> None:
    policy = NeuralArchitecture().build("program", InverseDynamics(backend="batched"))
    saved = load(SHIPPED, command="")
    restore_weights(policy.weights(), saved, name="neural", source=SHIPPED)
    assert saved.optimiser == {}
    outcome = execute(act(policy, tasks), tasks, SimulatorSettings())
    assert outcome.success.mean() >= 0.75


def test_inference_takes_it_by_name(tasks: TaskBatch, tmp_path: Path) -> None:
    for checkpoint in (None, "shipped", str(SHIPPED)):
        model = chosen_model("neural", checkpoint)
        assert model is not None
        planner = model.planner
        assert isinstance(planner, ClassPlanner)
        policy = getattr(planner.propose, "__self__", None)
        assert isinstance(policy, ProposalPolicy)
        assert isinstance(policy.scorer, Pointer)
    with pytest.raises(InvalidProblem, match="model: expected structured or neural, got thesis"):
        chosen_model("thesis", None)
    with pytest.raises(InvalidProblem, match="weights of model neural, got weights of model structured"):
        trained(STRUCTURED)
    with pytest.raises(InvalidProblem, match="experiment=neural"):
        trained(tmp_path / "none.safetensors")
