"""What comes of actions: executed in the simulator, and held against the desired motion (Thesis 4-CT8, 4-CT10)."""

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from dlm.execution import idle_where_unsolved, simulate
from dlm.inverse_dynamics.layer import Action
from dlm.metrics import finger_trajectory_loss, object_trajectory_loss, rms_errors, within
from dlm.policy import Policy
from dlm.simulator import SimulatorSettings
from dlm.tasks import TaskBatch
from expert.geometry.pose import Array

Mask = NDArray[np.bool_]

FALLEN = 5e-3
"""Dropped: the object ends this much below its desired height [m]."""


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """Of b tasks: what the fingers were to do (action), simulated and desired poses (b, t, 3), labels (b, t, c, 2) [m]."""

    action: Action
    poses: Array
    desired: Array
    labels: Array

    @property
    def object_loss(self) -> Array:
        """Object-trajectory loss (b,) [cm^2]."""
        return object_trajectory_loss(self.poses, self.desired)

    @property
    def finger_loss(self) -> Array:
        """Finger-trajectory loss (b,) [cm^2], against the expert's positions."""
        return finger_trajectory_loss(self.action.positions.numpy(), self.labels)

    @property
    def rms(self) -> tuple[float, float]:
        """Root mean square over tasks and steps: distance [mm] and angle [deg]."""
        move, turn = rms_errors(self.poses, self.desired)
        return float(np.sqrt(np.square(move).mean())), float(np.sqrt(np.square(turn).mean()))

    @property
    def success(self) -> Mask:
        """Last pose within 2 mm and 2 deg of the desired one, (b,)."""
        return within(self.poses, self.desired)

    @property
    def dropped(self) -> Mask:
        """Object ends more than FALLEN below its desired height, (b,)."""
        return (self.desired - self.poses)[:, -1, 1] > FALLEN

    @property
    def solved(self) -> Mask:
        """Whether the program was solved, (b,)."""
        return self.action.solved.numpy()


def act(policy: Policy, tasks: TaskBatch) -> Action:
    """The policy's action on every task, in evaluation mode; idle fingers where its program was not solved."""
    policy.eval()
    with torch.no_grad():
        return idle_where_unsolved(policy(tasks.video), tasks)


def execute(action: Action, tasks: TaskBatch, simulator: SimulatorSettings) -> Outcome:
    """Simulate an action on its tasks."""
    with torch.no_grad():
        poses = simulate(action, tasks, simulator)
    return Outcome(
        action=action, poses=poses.numpy(), desired=tasks.poses.numpy(), labels=tasks.positions.numpy()
    )
