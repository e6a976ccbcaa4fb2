"""The structured model, small, and told what perfect perception would see."""

from pathlib import Path

from matplotlib.figure import Figure

from dlm.metrics import object_trajectory_loss
from dlm.perception import Perceived
from dlm.policy import Loss, PolicyKind
from dlm.simulator import replay
from dlm.structured import StructuredModel
from dlm.structured.policies import StructuredArchitecture
from dlm.tasks import TaskBatch
from dlm.training.loop import Record, Row, Training, Watch, fit
from dlm.training.stage import Schedule, Stage


def seen_by_label(tasks: TaskBatch, k: int) -> Perceived:
    """The label's geometry, as if perception were perfect."""
    task = tasks.samples[k].task
    return Perceived(vertices=task.body.vertices, poses=task.trajectory.poses, residual=0.0, noise=0.0)


def executed(tasks: TaskBatch, k: int, model: StructuredModel, perceived: Perceived) -> float:
    planned = model.plan(perceived)
    assert planned.plan is not None
    desired = tasks.samples[k].task.trajectory.poses
    return float(
        object_trajectory_loss(
            replay(tasks.samples[k].task, planned.plan.positions, planned.plan.forces).poses, desired
        )
    )


SMALL = StructuredArchitecture(width=16, layers=1, heads=2)


QUIET = Watch(measure=lambda policy: {}, picture=lambda policy: Figure(figsize=(1, 1)))


def train(
    tasks: TaskBatch,
    path: Path,
    loss: Loss,
    *,
    kind: PolicyKind = "proposals",
    resume: bool = False,
    **schedule: float,
) -> list[Row]:
    """History of a short training, with a checkpoint at `path`."""
    stage = Stage(name=path.stem, policy=kind, loss=loss, dataset="train")
    plan = Schedule(
        **{
            "iterations": 6,
            "batch_size": 2,
            "save_every": 1,
            "log_every": 1,
            "learning_rate": 3e-3,
            **schedule,
        }
    )
    training = Training(SMALL.build(kind, seed=1), loss, tasks, plan)
    record = Record(path=path, stage=stage, model="structured", settings={})
    fit(training, record, watch=QUIET, resume=resume)
    return training.history
