"""Training losses: 4-CT5 on mechanical parameters, 4-CT7 on the program's solution, 4-CT10 on simulated motion.

All are means over tasks and numbers, without dimensions or in cm^2, so that batches of any size weigh alike.  Tasks whose
program was not solved have no action to compare, and are left out.
"""

from dataclasses import dataclass

from torch import Tensor

from dlm.execution import simulate
from dlm.inverse_dynamics.layer import Action
from dlm.inverse_dynamics.parameters import Layout, ParameterBatch
from dlm.metrics import finger_trajectory_loss, object_trajectory_loss
from dlm.policy import Policy
from dlm.simulator import SimulatorSettings
from dlm.tasks import TaskBatch
from dlm.thesis.policies import DerenderingPolicy
from expert.errors import InvalidProblem


def parameter_distance(rows: Tensor, target: ParameterBatch, layout: Layout) -> Tensor:
    """4-CT5: ||P* - P||^2, mean over the numbers of P that mean something, each over its physical scale."""
    weight = layout.relevance(target)
    return (weight * (rows.double() - layout.flatten(target)).square()).sum() / weight.sum()


def action_distance(action: Action, tasks: TaskBatch, *, force_weight: float) -> Tensor:
    """||p* - p||^2 [cm^2] + force_weight ||lambda* - lambda||^2 [(m g)^2] of each task, (b,): means over its numbers."""
    position = finger_trajectory_loss(action.positions, tasks.positions)
    force = (action.forces - tasks.forces) / tasks.weight[:, None, None, None]
    return position + force_weight * force.square().mean((1, 2, 3))


def slack_size(action: Action, tasks: TaskBatch) -> Tensor:
    """|eps|_1 of each task, (b,), over m g and m g L."""
    force, torque = action.slack[..., :2], action.slack[..., 2] / tasks.size[:, None]
    return (force.abs().sum((1, 2)) + torque.abs().sum(1)) / tasks.weight


def mean_over(solved: Tensor, values: Tensor) -> Tensor:
    """Mean of values (b,) over the solved tasks; 0 if there is none."""
    return (solved * values).sum() / solved.sum().clamp(min=1)


@dataclass(frozen=True, kw_only=True)
class ParameterLoss:
    """4-CT5, for MDR."""

    def __call__(self, policy: Policy, tasks: TaskBatch) -> Tensor:
        if not isinstance(policy, DerenderingPolicy):
            raise InvalidProblem("stage.loss", expected="a policy that derenders", got=type(policy).__name__)
        rows = policy.derenderer(tasks.video)
        return parameter_distance(rows, tasks.parameters, policy.derenderer.layout)


@dataclass(frozen=True, kw_only=True)
class ActionLoss:
    """4-CT7 with weight q = slack_weight for CVX; without slack, L_NN of NN.

    The thesis trains NN on positions alone; here on forces too, because the execution layer needs both.
    """

    force_weight: float = 1.0
    slack_weight: float = 0.0

    def __call__(self, policy: Policy, tasks: TaskBatch) -> Tensor:
        action = policy(tasks.video)
        distance = action_distance(action, tasks, force_weight=self.force_weight)
        return mean_over(action.solved, distance + self.slack_weight * slack_size(action, tasks))


@dataclass(frozen=True, kw_only=True)
class SimulationLoss:
    """4-CT10, for NNM and DLM: ||Sim(p*, lambda*) - r||^2 [cm^2], in a simulator with smoothed contact."""

    simulator: SimulatorSettings

    def __call__(self, policy: Policy, tasks: TaskBatch) -> Tensor:
        action = policy(tasks.video)
        poses = simulate(action, tasks, self.simulator)
        return mean_over(action.solved, object_trajectory_loss(poses, tasks.poses))
