import time

import torch

from dlm.evaluation.timing import backward_seconds, expert_seconds, forward_seconds
from dlm.inverse_dynamics.layer import Action, InverseDynamics
from dlm.inverse_dynamics.parameters import Layout
from dlm.policy import Policy
from dlm.tasks import TaskBatch
from dlm.thesis.derender import NetworkSizes
from dlm.thesis.losses import ActionLoss
from dlm.thesis.policies import PerceptronPolicy, ThesisArchitecture

SMALL = NetworkSizes(channels=(2, 3, 4), latent=8, recurrent_layers=1, hidden_layers=1)


class Busy(PerceptronPolicy):
    """Works for a while before it answers."""

    def forward(self, video: torch.Tensor) -> Action:
        end = time.process_time() + 0.02
        while time.process_time() < end:
            pass
        return super().forward(video)


def small() -> Policy:
    return ThesisArchitecture(sizes=SMALL, layout=Layout()).build("perceptron", InverseDynamics(), seed=0)


def test_work_is_told_from_waiting(tasks: TaskBatch) -> None:
    seconds = forward_seconds(Busy(Layout(), SMALL), tasks)
    assert seconds >= 0.02
    assert expert_seconds(tasks) > 0


def test_timing_leaves_weights_gradients_and_random_numbers_alone(tasks: TaskBatch) -> None:
    policy = small()
    before, state = [p.clone() for p in policy.parameters()], torch.get_rng_state()
    assert backward_seconds(policy, ActionLoss(), tasks) > 0
    assert all(torch.equal(a, b) for a, b in zip(before, policy.parameters(), strict=True))
    assert all(p.grad is None for p in policy.parameters())
    assert torch.equal(torch.get_rng_state(), state)
    assert not policy.training
