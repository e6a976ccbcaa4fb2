"""Labelled tasks as tensors: what policies see, what losses compare with, and the scenes in which actions are executed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from datasets.specification import Sample
from datasets.store import read_dataset
from dlm.inverse_dynamics.parameters import ParameterBatch
from dlm.simulator.scene import SceneBatch
from expert.world.values import require


@dataclass(frozen=True, kw_only=True)
class TaskBatch:
    """b tasks; t step, c finger, d coordinate.

    video (b, t, h, w, 3) uint8; parameters P; positions, forces (b, t, c, d) of the expert's plans; weight (b,) m g [N], size (b,) of the objects [m];
    scenes: objects, environments and desired motions; samples: the tasks themselves; fingerprint: of the whole data set.
    """

    video: Tensor
    parameters: ParameterBatch
    positions: Tensor
    forces: Tensor
    weight: Tensor
    size: Tensor
    scenes: SceneBatch
    samples: tuple[Sample, ...]
    fingerprint: str

    @classmethod
    def of(cls, samples: Sequence[Sample], fingerprint: str = "") -> "TaskBatch":
        """Stack samples.  Raises InvalidProblem for none."""
        require(len(samples) > 0, "dataset", "at least one task", 0)
        return cls(
            video=torch.from_numpy(np.stack([s.video for s in samples])),
            parameters=ParameterBatch.stack([s.parameters for s in samples]),
            positions=torch.from_numpy(np.stack([s.plan.positions for s in samples])),
            forces=torch.from_numpy(np.stack([s.plan.forces for s in samples])),
            weight=torch.tensor([s.task.weight for s in samples], dtype=torch.float64),
            size=torch.tensor([s.task.body.size for s in samples], dtype=torch.float64),
            scenes=SceneBatch.of([s.task for s in samples]),
            samples=tuple(samples),
            fingerprint=fingerprint,
        )

    @classmethod
    def read(cls, folder: str | Path, count: int | None = None) -> "TaskBatch":
        """A data set, or its first `count` tasks.

        Raises InvalidProblem where it is missing, unfinished, empty, damaged, or smaller.
        """
        data = read_dataset(folder)
        if count is not None:
            fits = isinstance(count, int) and 2 <= count <= len(data)
            require(fits, "train_tasks", f"a whole number from 2 to {len(data)}", count)
        return cls.of([data[i] for i in range(len(data) if count is None else count)], data.sha256)

    def __len__(self) -> int:
        return len(self.samples)

    def __getitem__(self, rows: Tensor) -> "TaskBatch":
        """Some of the tasks, by number."""
        index = rows.tolist()
        return replace(
            self,
            video=self.video[rows],
            parameters=self.parameters.map(lambda value: value[rows]),
            positions=self.positions[rows],
            forces=self.forces[rows],
            weight=self.weight[rows],
            size=self.size[rows],
            scenes=self.scenes[index],
            samples=tuple(self.samples[i] for i in index),
        )

    @property
    def poses(self) -> Tensor:
        """Desired poses (b, t, 3)."""
        return torch.from_numpy(self.scenes.desired)


def read_all(folders: Mapping[str, str | Path], *, train_tasks: int | None = None) -> dict[str, TaskBatch]:
    """Several data sets by name, of `train` the first so many tasks; what is named twice is read once."""
    wanted = {name: (folder, train_tasks if name == "train" else None) for name, folder in folders.items()}
    read = {part: TaskBatch.read(*part) for part in dict.fromkeys(wanted.values())}
    return {name: read[part] for name, part in wanted.items()}


def first(tasks: Mapping[str, TaskBatch], most: int | None) -> dict[str, TaskBatch]:
    """The first so many tasks of each data set; None: all."""
    require(most is None or (isinstance(most, int) and most >= 2), "tasks", "a number of at least 2", most)
    return {name: batch[torch.arange(min(most or len(batch), len(batch)))] for name, batch in tasks.items()}
