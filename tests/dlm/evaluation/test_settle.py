import pytest
import torch
from torch import nn

from dlm.evaluation.settle import settle
from dlm.inverse_dynamics.layer import InverseDynamics
from dlm.inverse_dynamics.parameters import Layout
from dlm.policy import Policy
from dlm.tasks import TaskBatch
from dlm.thesis.derender import NetworkSizes
from dlm.thesis.losses import ActionLoss
from dlm.thesis.policies import ThesisArchitecture
from dlm.training.loop import Training
from dlm.training.stage import Schedule

SMALL = NetworkSizes(channels=(2, 3, 4), latent=8, recurrent_layers=1, hidden_layers=1, dropout=0.5)


def trained(tasks: TaskBatch) -> Policy:
    policy = ThesisArchitecture(sizes=SMALL, layout=Layout()).build("perceptron", InverseDynamics(), seed=0)
    policy.fit_centre(tasks)
    training = Training(policy, ActionLoss(), tasks, Schedule(batch_size=4, learning_rate=1e-2))
    for _ in range(5):
        training.iterate()
    return policy


def answer(policy: Policy, tasks: TaskBatch) -> torch.Tensor:
    with torch.no_grad():
        return policy(tasks.video).positions


def rows_seen(policy: Policy) -> dict[nn.BatchNorm1d, int]:
    """How many rows each batch norm was given last; filled as they pass."""
    counts: dict[nn.BatchNorm1d, int] = {}

    def note(norm: nn.BatchNorm1d, given: tuple[torch.Tensor], _: torch.Tensor) -> None:
        counts[norm] = given[0].numel() // given[0].shape[1]

    for module in policy.modules():
        if isinstance(module, nn.BatchNorm1d):
            module.register_forward_hook(note)
    return counts


def test_a_settled_network_answers_as_batch_statistics_without_dropout_would_have_it(
    tasks: TaskBatch,
) -> None:
    policy = trained(tasks).train()
    for module in policy.modules():
        if isinstance(module, nn.Dropout):
            module.eval()
    wanted = answer(policy, tasks)
    policy.eval()
    assert (answer(policy, tasks) - wanted).abs().max() > 1e-3  # running averages differ
    weights = [p.clone() for p in policy.parameters()]
    counts = rows_seen(policy)
    settle(policy, tasks)
    assert not policy.training
    assert counts
    for norm, count in counts.items():  # a batch is divided by its variance; what is kept is the unbiased one
        assert norm.running_var is not None
        norm.running_var.mul_((count - 1) / count)
    assert (answer(policy, tasks) - wanted).abs().max() < 1e-3 * wanted.std()
    assert all(torch.equal(a, b) for a, b in zip(weights, policy.parameters(), strict=True))


def test_settling_twice_changes_nothing_more(tasks: TaskBatch) -> None:
    policy = trained(tasks)
    settle(policy, tasks)
    once = answer(policy, tasks)
    settle(policy, tasks)
    torch.testing.assert_close(answer(policy, tasks), once)


def test_of_a_large_data_set_the_first_tasks_are_enough(
    tasks: TaskBatch, monkeypatch: pytest.MonkeyPatch
) -> None:
    policy = trained(tasks)
    counts = rows_seen(policy)
    monkeypatch.setattr("dlm.evaluation.settle.ENOUGH", 3)
    settle(policy, tasks)
    assert {3, 3 * tasks.video.shape[1]} >= set(counts.values())
