"""What `model: neural` learns by without labels: simulated motion, expected over the likeliest contact classes (DLM).

MDR and CVX learn by the losses of the structured model, cross-entropy and what classes cost the program: the pointer ranks
the same classes.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from dlm.execution import idle_where_unsolved, simulate
from dlm.metrics import object_trajectory_loss
from dlm.neural.policies import PointerPolicy, geometry_of
from dlm.policy import Policy
from dlm.simulator import SimulatorSettings
from dlm.tasks import TaskBatch
from expert.errors import InvalidProblem


@dataclass(frozen=True, kw_only=True)
class ExpectedMotionLoss:
    """4-CT10 in expectation: sum over the likeliest `classes` of share log(1 + L_sim / near), mean over the tasks.

    Shares are differentiable in the network's weights, L_sim in the calibration, through program and simulator.  near [cm^2]:
    losses far below it are all alike, a dropped object weighs little more than one that is missed.
    """

    simulator: SimulatorSettings
    classes: int = 4
    near: float = 1e-2

    def __call__(self, policy: Policy, tasks: TaskBatch) -> Tensor:
        if not isinstance(policy, PointerPolicy):
            raise InvalidProblem("stage.loss", expected="a policy that points", got=type(policy).__name__)
        seen, rows = policy.seen(tasks.video)
        if not seen:
            return policy.knobs.sum() * 0.0
        geometry = geometry_of(seen)
        classes, shares = policy.likeliest(geometry, self.classes)
        every = torch.arange(len(seen)).repeat_interleave(self.classes)
        action = policy.act(geometry[every], classes.reshape(-1, 3))
        again = tasks[torch.tensor(rows)[every]]
        poses = simulate(idle_where_unsolved(action, again), again, self.simulator)
        losses = object_trajectory_loss(poses, again.poses).view_as(shares)
        return (shares.exp() * (losses / self.near).log1p()).sum(1).mean()
