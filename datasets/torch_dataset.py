"""Torch view of a data set: tensors by field name, ready for a DataLoader; the tasks themselves stay at hand."""

from pathlib import Path

import numpy as np
import torch
from torch import Tensor
from torch.utils.data import Dataset

from datasets.fields import FIELDS
from datasets.motions import FAMILIES
from datasets.specification import Sample
from datasets.store import DataSet, read_dataset
from expert.errors import InvalidProblem
from expert.problems.contact import ContactTask

STATUSES = ("optimal", "feasible")


class TaskDataset(Dataset[dict[str, Tensor]]):
    """Item i: every field of FIELDS as a tensor; video uint8 (T, y, x, colour), mechanics float64, whole numbers int64.

    Texts become numbers: `family` its place in FAMILIES, `status` its place in STATUSES.
    """

    def __init__(self, data: DataSet) -> None:
        self.data = data
        self.tensors = {name: _tensor(name, array, data.folder) for name, array in data.arrays.items()}

    def __len__(self) -> int:
        return len(self.data)

    def __getitem__(self, i: int) -> dict[str, Tensor]:
        return {name: tensor[i] for name, tensor in self.tensors.items()}

    def sample(self, i: int) -> Sample:
        """Task, plan, video and parameters of item i."""
        return self.data[i]


def load(path: str | Path) -> TaskDataset:
    """Read and check a data set; raises InvalidProblem as read_dataset does."""
    return TaskDataset(read_dataset(path))


def task_of(dataset: TaskDataset, i: int) -> ContactTask:
    """The contact-trajectory problem that item i was labelled on."""
    return dataset.sample(i).task


def _tensor(name: str, array: np.ndarray, folder: Path) -> Tensor:
    if FIELDS[name].kind != "U":
        return torch.from_numpy(np.ascontiguousarray(array))
    words = tuple(FAMILIES) if name == "family" else STATUSES
    if unknown := sorted(set(array.tolist()) - set(words)):
        raise InvalidProblem(
            f"{folder} {name}", expected="one of " + ", ".join(words), got=", ".join(unknown)
        )
    return torch.tensor([words.index(word) for word in array.tolist()])
