"""Outcomes of known errors."""

from dlm.evaluation.outcomes import Outcome
from dlm.execution import expert_action
from dlm.simulator import SimulatorSettings
from dlm.tasks import TaskBatch

RIGID = SimulatorSettings()


def outcome(tasks: TaskBatch, **shift: float) -> Outcome:
    """The expert's action with poses moved away from the desired ones at the last step."""
    poses = tasks.poses.numpy().copy()
    for name, value in shift.items():
        poses[:, -1, ["x", "y", "theta"].index(name)] += value
    return Outcome(
        action=expert_action(tasks),
        poses=poses,
        desired=tasks.poses.numpy(),
        labels=tasks.positions.numpy(),
    )
