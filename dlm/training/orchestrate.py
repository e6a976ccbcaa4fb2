"""Stages of several seeds: one after the other, or chains of stages side by side in processes."""

import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Annotated, Any

import torch

from datasets.limits import Number, check_numbers
from datasets.parallel import followed, progress_bar, side_by_side
from dlm.inverse_dynamics.layer import InverseDynamics
from dlm.policy import Architecture, Policy
from dlm.tasks import TaskBatch
from dlm.training.checkpoint import load, read_about, restore_weights
from dlm.training.loop import Record, Training, Watch, fit
from dlm.training.stage import Schedule, Stage
from expert.errors import InvalidProblem
from expert.files.output import claimed
from expert.world.values import require

DataSets = Mapping[str, TaskBatch]
"""Data sets by the names that stages give them."""


@dataclass(frozen=True, kw_only=True)
class Run:
    """The stages of one seed.

    model, program: how policies are built, the quadratic program anew for each.  schedule: what stages do not change.
    read, watch: the data sets, and what is measured on them while a stage learns.  folder: of the checkpoints.
    settings: the plain values that all this was made of, with the stages' under `stages`; a checkpoint keeps them.
    threads: of this process.  resume: go on from the checkpoints that there are.
    """

    seed: int
    stages: Sequence[Stage]
    model: Architecture
    program: Callable[[], InverseDynamics]
    schedule: Schedule
    read: Callable[[], DataSets]
    watch: Callable[[DataSets], Watch]
    folder: Path
    settings: Mapping[str, Any]
    threads: Annotated[int, Number(whole=True, least=1, most=1024)] = 1
    resume: bool = False

    def __post_init__(self) -> None:
        check_numbers(self)

    def train(self, stage: Stage, tasks: DataSets) -> str:
        """One stage, from fresh weights or from those of its warm start; a line that says where it is."""
        torch.set_num_threads(self.threads)
        policy = self.model.build(stage.policy, self.program(), seed=self.seed)
        policy.fit_centre(tasks["train"])
        if stage.warm_start:
            self._start_from(stage.warm_start, policy)
        record = self.record(stage)
        training = Training(policy, stage.loss, tasks[stage.dataset], stage.scheduled(self.schedule))
        with claimed(self.folder / stage.name):
            fit(training, record, watch=self.watch(tasks), resume=self.resume)
        return f"{stage.name}: {record.path} ({training.seconds:.0f} s of processor time)"

    def record(self, stage: Stage) -> Record:
        """Where a stage's checkpoint is and what it says; its settings are enough to rebuild the policy."""
        common = {key: value for key, value in self.settings.items() if key != "stages"}
        return Record(
            path=checkpoint_path(self.folder, stage.name),
            stage=stage,
            model=self.model.name,
            settings={**common, "stage": self.settings["stages"][stage.name]},
        )

    def _start_from(self, earlier: str, policy: Policy) -> None:
        """Load the weights of an earlier stage."""
        path, name = checkpoint_path(self.folder, earlier), self.model.name
        group = "" if name == "thesis" else f"{name}/"
        command = f"python train.py stage={group}{earlier} model={name} seed={self.seed} output={self.folder.parent}"
        restore_weights(policy.weights(), load(path, command=command), name=name, source=path)


def seed_folder(output: str | Path, seed: int) -> Path:
    """Where the checkpoints of one seed are."""
    return Path(output) / f"seed_{seed}"


def checkpoint_path(folder: Path, stage: str) -> Path:
    """Where the checkpoint of a stage is."""
    return folder / f"{stage}.safetensors"


def train(runs: Sequence[Run], *, jobs: int) -> Iterator[str]:
    """Train every stage of every run, each after the one whose weights it starts from; a line for each.

    jobs: processes; with more than one, the longest chains of stages begin first.  Raises InvalidProblem for bad input,
    SolverFailed where a worker dies.
    """
    require(isinstance(jobs, int) and jobs >= 1, "jobs", "a number of processes", jobs)
    tasks = runs[0].read()
    if jobs == 1:
        for run in runs:
            for stage in run.stages:
                yield run.train(stage, tasks)
        return
    rows = [(run, stages) for stages in chains(runs[0].stages) for run in runs]
    calls = [partial(_train_chain, run, [stage.name for stage in stages]) for run, stages in rows]
    with _progress_of(runs):
        again = "the same command with resume=true"
        yield from chain.from_iterable(side_by_side(calls, jobs=jobs, again=again))


def chains(stages: Sequence[Stage]) -> list[list[Stage]]:
    """Stages that start from one another's weights, in order; different chains do not wait for each other.  Longest first."""
    found: list[list[Stage]] = []
    for stage in stages:
        before = [row for row in found if stage.warm_start in [earlier.name for earlier in row]]
        if before:
            before[0].append(stage)
        else:
            found.append([stage])
    return sorted(found, key=len, reverse=True)


def _train_chain(run: Run, names: Sequence[str]) -> list[str]:
    """Stages of one seed in order, in a process of their own."""
    tasks = run.read()
    return [run.train(stage, tasks) for stage in run.stages if stage.name in names]


@contextmanager
def _progress_of(runs: Sequence[Run]) -> Iterator[None]:
    """A bar over the iterations of all stages, and a last word where somebody interrupts."""
    total = sum(stage.scheduled(run.schedule).iterations for run in runs for stage in run.stages)
    done = partial(iterations_done, runs, time.time())
    try:
        with progress_bar("iterations", total) as show, followed(show, done):
            yield
            show(total)
    except KeyboardInterrupt:
        print(
            f"interrupted after {done()} of {total} iterations; the same command with resume=true goes on",
            file=sys.stderr,
        )
        raise


def iterations_done(runs: Sequence[Run], start: float) -> int:
    """Iterations in the checkpoints of all runs; those written before `start` count only if they are gone on from."""
    done = 0
    for run in runs:
        for path in (checkpoint_path(run.folder, stage.name) for stage in run.stages):
            try:
                if run.resume or path.stat().st_mtime >= start:
                    done += read_about(path, command="").iteration
            except (FileNotFoundError, InvalidProblem):
                continue  # not begun, or about to be refused by the worker
    return done
