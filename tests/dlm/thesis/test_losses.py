import pytest
import torch

from dlm.execution import expert_action, given_action, simulate
from dlm.inverse_dynamics.layer import InverseDynamics
from dlm.inverse_dynamics.parameters import Layout
from dlm.policy import Policy
from dlm.simulator import SimulatorSettings
from dlm.tasks import TaskBatch
from dlm.thesis.derender import NetworkSizes
from dlm.thesis.losses import (
    ActionLoss,
    ParameterLoss,
    SimulationLoss,
    action_distance,
    mean_over,
    parameter_distance,
    slack_size,
)
from dlm.thesis.policies import ThesisArchitecture

MODEL = ThesisArchitecture(sizes=NetworkSizes(), layout=Layout())


@pytest.fixture(scope="module")
def program() -> InverseDynamics:
    return InverseDynamics()


@pytest.fixture(scope="module", params=["perceptron", "program"])
def policy(request: pytest.FixtureRequest, program: InverseDynamics, tasks: TaskBatch) -> Policy:
    built = MODEL.build(request.param, program, seed=0)
    built.fit_centre(tasks)
    return built


def test_4_ct5_vanishes_at_the_truth_and_ignores_fillers(tasks: TaskBatch) -> None:
    layout = Layout()
    rows = layout.flatten(tasks.parameters)
    assert parameter_distance(rows, tasks.parameters, layout) == 0
    weight = layout.relevance(tasks.parameters)
    fillers = rows + 7.0 * (weight == 0)
    assert (weight == 0).any()
    assert parameter_distance(fillers, tasks.parameters, layout) == 0
    everywhere = parameter_distance(rows + 0.5, tasks.parameters, layout)
    assert float(everywhere) == pytest.approx(0.25)


def test_4_ct7_counts_square_centimetres_and_square_weights(tasks: TaskBatch) -> None:
    expert = expert_action(tasks)
    assert (action_distance(expert, tasks, force_weight=1.0) == 0).all()
    moved = given_action(expert.positions + 0.02, expert.forces)
    torch.testing.assert_close(
        action_distance(moved, tasks, force_weight=1.0), torch.full((len(tasks),), 4.0).double()
    )
    pushed = given_action(expert.positions, expert.forces + 3 * tasks.weight[:, None, None, None])
    torch.testing.assert_close(
        action_distance(pushed, tasks, force_weight=0.5), torch.full((len(tasks),), 4.5).double()
    )


def test_slack_is_measured_in_weights_and_sizes(tasks: TaskBatch) -> None:
    action = expert_action(tasks)
    action.slack[:, 0, 1] = -tasks.weight
    action.slack[:, 2, 2] = 2 * tasks.weight * tasks.size
    torch.testing.assert_close(slack_size(action, tasks), torch.full((len(tasks),), 3.0).double())


def test_unsolved_tasks_are_left_out() -> None:
    values = torch.tensor([1.0, 100.0, 3.0])
    assert mean_over(torch.tensor([True, False, True]), values) == 2
    assert mean_over(torch.zeros(3, dtype=torch.bool), values) == 0


def test_4_ct10_is_the_loss_of_the_simulated_motion(tasks: TaskBatch) -> None:
    settings = SimulatorSettings()

    class Expert(torch.nn.Module):
        def forward(self, video: torch.Tensor) -> object:
            return expert_action(tasks)

    loss = SimulationLoss(simulator=settings)(Expert(), tasks)  # type: ignore[arg-type]
    poses = simulate(expert_action(tasks), tasks, settings)
    error = 100 * (poses - tasks.poses)
    error[..., 2] = 3 * (poses[..., 2].sin() - tasks.poses[..., 2].sin())
    assert float(loss) == pytest.approx(float(error.square().mean()), rel=1e-12)


LOSSES = {
    "4-CT5": ParameterLoss(),
    "4-CT7": ActionLoss(slack_weight=0.1),
    "4-CT10": SimulationLoss(simulator=SimulatorSettings(kappa=1250.0)),
}


@pytest.mark.parametrize("name", LOSSES)
def test_every_loss_reaches_every_weight_that_it_should(name: str, policy: Policy, tasks: TaskBatch) -> None:
    optimiser = torch.optim.Adam(policy.parameters(), lr=1e-3)
    for _ in range(4):  # last layers start at zero, and let gradients pass once they have moved
        optimiser.zero_grad()
        LOSSES[name](policy, tasks).backward()
        optimiser.step()
    untouched = {n for n, p in policy.named_parameters() if p.grad is None or not p.grad.abs().max() > 0}
    assert untouched == (without_labels(policy, tasks) if name == "4-CT5" else set())
    assert all(torch.isfinite(p.grad).all() for p in policy.parameters() if p.grad is not None)


def without_labels(policy: Policy, tasks: TaskBatch) -> set[str]:
    """Weights that P does not speak of: the actor's, and of heads whose fields are fillers in all tasks."""
    layout = Layout()
    weight = layout.split(layout.relevance(tasks.parameters))
    heads = {f"derenderer.heads.{field}." for field, value in weight.items() if not value.any()}
    assert 0 < len(heads) < len(weight)
    return {n for n, _ in policy.named_parameters() if n.startswith(("actor.", *heads))}
