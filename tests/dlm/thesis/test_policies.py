import pytest
import torch

from dlm.inverse_dynamics.layer import InverseDynamics
from dlm.inverse_dynamics.parameters import Layout
from dlm.tasks import TaskBatch
from dlm.thesis.derender import NetworkSizes
from dlm.thesis.policies import ThesisArchitecture
from expert.errors import InvalidProblem

SMALL = NetworkSizes(channels=(2, 3, 4), latent=8, recurrent_layers=1, hidden_layers=1)
MODEL = ThesisArchitecture(sizes=SMALL, layout=Layout())


def test_an_untrained_perceptron_answers_with_the_average_plan(tasks: TaskBatch) -> None:
    policy = MODEL.build("perceptron", InverseDynamics(), seed=0).eval()
    policy.fit_centre(tasks)
    action = policy(tasks.video)
    assert action.solved.all()
    torch.testing.assert_close(action.positions, tasks.positions.mean(0).expand_as(action.positions))
    torch.testing.assert_close(action.forces, tasks.forces.mean(0).expand_as(action.forces))


def test_the_program_policy_acts_on_what_is_derendered(tasks: TaskBatch) -> None:
    program = InverseDynamics(backend="batched")
    policy = MODEL.build("program", program, seed=0).eval()
    policy.fit_centre(tasks)
    with torch.no_grad():
        action = policy(tasks.video)
        alone = program(policy.derenderer.parameters_of(tasks.video))  # type: ignore[operator, union-attr]
    assert torch.equal(action.positions, alone.positions)
    assert action.solved.all()


def test_weights_follow_the_seed() -> None:
    one, again, other = (MODEL.build("perceptron", InverseDynamics(), seed=s).weights() for s in (1, 1, 2))
    assert all(torch.equal(one[name], again[name]) for name in one)
    assert any(not torch.equal(one[name], other[name]) for name in one)


def test_policies_of_another_model_are_refused() -> None:
    with pytest.raises(InvalidProblem, match=r"stage\.policy: expected perceptron or program, got proposals"):
        MODEL.build("proposals", InverseDynamics(), seed=0)
