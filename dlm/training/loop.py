"""Training of one stage (Thesis 4.3): Adam on one loss over the tasks of one data set.

A stage can be stopped at any moment; continued from its last checkpoint it takes exactly the steps that it would have taken.
"""

import shutil
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import torch
from matplotlib.figure import Figure
from torch.utils.tensorboard import SummaryWriter

from datasets.parallel import progress_bar
from dlm.policy import Loss, Policy, seeded
from dlm.tasks import TaskBatch
from dlm.training.checkpoint import (
    About,
    Checkpoint,
    load,
    optimiser_tensors,
    restore_optimiser,
    restore_weights,
)
from dlm.training.stage import Schedule, Stage
from expert.errors import InvalidProblem, SolverFailed
from expert.world.values import require

Row = dict[str, float]


@dataclass(frozen=True, kw_only=True)
class Record:
    """Where the checkpoints of a stage go, and what they say of it: the model's name, and settings as plain values."""

    path: Path
    stage: Stage
    model: str
    settings: Mapping[str, object]


class Training:
    """State of one stage: everything that the next iteration depends on; seconds: processor time that it took so far."""

    def __init__(self, policy: Policy, loss: Loss, tasks: TaskBatch, schedule: Schedule) -> None:
        require(
            len(tasks) >= 2, "dataset", "at least 2 tasks to train on", len(tasks), "generate a larger one"
        )
        self.policy, self.loss, self.tasks, self.schedule = policy, loss, tasks, schedule
        self.optimiser = torch.optim.Adam(policy.parameters(), lr=schedule.learning_rate, fused=True)
        self.iteration = 0
        self.history: list[Row] = []
        self.seconds = 0.0

    def iterate(self) -> float:
        """One pass over the tasks in random order; the mean loss."""
        self.policy.train()
        losses = []
        batches = self._batches()
        for k, rows in enumerate(batches):
            rate = self.schedule.rate((self.iteration + k / len(batches)) / self.schedule.iterations)
            self.optimiser.param_groups[0]["lr"] = rate
            losses.append(self._descend(self.tasks[rows]))
        self.iteration += 1
        return sum(losses) / len(losses)

    def is_due(self, every: int) -> bool:
        """Whether what happens every so many iterations, and after the last one, happens now."""
        return self.iteration % every == 0 or self.iteration == self.schedule.iterations

    def _batches(self) -> list[torch.Tensor]:
        """Random batches of equal sizes up to one: batch norm needs more than one task in each."""
        count = -(-len(self.tasks) // self.schedule.batch_size)
        batches = torch.tensor_split(torch.randperm(len(self.tasks)), count)
        return [rows for rows in batches if len(rows) > 1]

    def _descend(self, tasks: TaskBatch) -> float:
        self.optimiser.zero_grad()
        loss = self.loss(self.policy, tasks)
        loss.backward()
        gradients = [p.grad for p in self.policy.parameters() if p.grad is not None]
        if not all(bool(torch.isfinite(x).all()) for x in (loss, *gradients)):
            raise SolverFailed(f"iteration {self.iteration + 1}: the loss or its gradient is not finite")
        self.optimiser.step()
        return loss.item()

    def checkpoint(self, record: Record) -> Checkpoint:
        """The state as it is, with what made it."""
        about = About(
            stage=record.stage.name,
            model=record.model,
            iteration=self.iteration,
            settings=dict(record.settings),
            data=self.tasks.fingerprint,
            history=self.history,
            seconds=self.seconds,
        )
        return Checkpoint(
            about=about,
            model=self.policy.weights(),
            optimiser=optimiser_tensors(self.optimiser),
            random=torch.get_rng_state(),
        )

    def restore(self, saved: Checkpoint, record: Record) -> None:
        """Go back to a saved state."""
        restore_weights(self.policy.weights(), saved, name=record.model, source=record.path)
        restore_optimiser(self.optimiser, saved.optimiser)
        torch.set_rng_state(saved.random)
        self.iteration, self.history = saved.about.iteration, list(saved.about.history)
        self.seconds = saved.about.seconds


@dataclass(frozen=True, kw_only=True)
class Watch:
    """What is looked at while a stage learns: losses on data sets, and a picture."""

    measure: Callable[[Policy], Row]
    picture: Callable[[Policy], Figure]


def fit(training: Training, record: Record, *, watch: Watch, resume: bool) -> None:
    """Train to the end of the schedule, with checkpoints as recorded and curves for TensorBoard beside them."""
    path, title = record.path, record.stage.name
    curves = path.parent / "tensorboard" / title
    with seeded(training.schedule.seed):
        if resume and path.exists():
            training.restore(checked(record, training), record)
        else:
            shutil.rmtree(curves, ignore_errors=True)
        with SummaryWriter(str(curves), purge_step=training.iteration + 1) as writer:
            try:
                for loss in _iterations(training, title):
                    if training.is_due(training.schedule.log_every) or training.iteration == 1:
                        _log(training, loss, watch, writer)
                    if training.is_due(training.schedule.save_every):
                        training.checkpoint(record).save(path)
            except KeyboardInterrupt:
                again = f"resume=true goes on from {path}" if path.exists() else "nothing was saved yet"
                print(
                    f"interrupted after {training.iteration} iterations of {title}; {again}", file=sys.stderr
                )
                raise
            writer.add_figure("scene", watch.picture(training.policy), training.iteration)


def _iterations(training: Training, title: str) -> Iterator[float]:
    """Losses of the iterations that are left, with a progress bar."""
    total = training.schedule.iterations
    with progress_bar(title, total, training.iteration) as show:
        start = time.process_time()
        while training.iteration < total:
            loss = training.iterate()
            start, before = time.process_time(), start
            training.seconds += start - before  # with what was measured since the iteration before
            yield loss
            show(training.iteration, f"{title} {loss:.3g}")


def checked(record: Record, training: Training) -> Checkpoint:
    """The checkpoint that this very training may continue.  Raises InvalidProblem where data or settings have changed."""
    path, stage = record.path, record.stage
    saved = load(path, command=f"python train.py stage={stage.name}")
    again = "resume=false trains from the start"
    if saved.about.data != training.tasks.fingerprint:
        raise InvalidProblem(
            f"checkpoint {path}",
            expected="the data that it was trained on",
            got=f"data set {stage.dataset} with other contents",
            remedy=again,
        )
    decays = training.schedule.decay != "constant"  # then steps depend on how many there are to be
    free = FREE_TO_CHANGE[1:] if decays else FREE_TO_CHANGE
    if name := _first_difference(saved.about.settings, record.settings, free):
        raise InvalidProblem(
            f"checkpoint {path}", expected="the same settings", got=f"another {name}", remedy=again
        )
    return saved


FREE_TO_CHANGE = ("schedule.iterations", "schedule.log_every", "schedule.save_every")
"""Settings that leave the steps alone."""


def _first_difference(
    a: Mapping[str, object], b: Mapping[str, object], free: Sequence[str], prefix: str = ""
) -> str | None:
    """Name of the first setting that differs, apart from those that are free to."""
    for key in sorted({*a, *b}):
        name, x, y = prefix + key, a.get(key), b.get(key)
        if isinstance(x, Mapping) and isinstance(y, Mapping):
            if found := _first_difference(x, y, free, f"{name}."):
                return found
        elif x != y and name not in free:
            return name
    return None


def _log(training: Training, loss: float, watch: Watch, writer: SummaryWriter) -> None:
    row = {"iteration": float(training.iteration), "loss": loss, **watch.measure(training.policy)}
    training.history.append(row)
    for name, value in row.items():
        if name != "iteration":
            writer.add_scalar(name, value, training.iteration)
