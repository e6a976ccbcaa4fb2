"""The torch view holds the stored numbers, in the types that training expects."""

from pathlib import Path

import numpy as np
import pytest
import torch
from torch.utils.data import DataLoader

from datasets.fields import FIELDS
from datasets.store import read_dataset
from datasets.torch_dataset import TaskDataset, load, task_of
from expert.errors import InvalidProblem


def test_items_are_named_tensors_of_stated_type(made: Path) -> None:
    dataset = load(made)
    item = dataset[3]
    assert len(dataset) == 6
    assert set(item) == set(FIELDS)
    assert item["video"].dtype == torch.uint8
    assert item["video"].shape == (5, 50, 50, 3)
    assert item["forces"].dtype == item["parameter_facets"].dtype == torch.float64
    assert item["modes"].dtype == item["family"].dtype == torch.int64
    assert [int(dataset[i]["family"]) for i in range(6)] == [0, 1, 2, 3, 4, 5]
    for name, array in dataset.data.arrays.items():
        if FIELDS[name].kind != "U":
            assert np.array_equal(item[name].numpy(), array[3]), name


def test_a_loader_batches_them(made: Path) -> None:
    batches = list(DataLoader(load(made), batch_size=4))
    assert [len(b["index"]) for b in batches] == [4, 2]
    assert batches[0]["video"].shape == (4, 5, 50, 50, 3)
    assert torch.cat([b["index"] for b in batches]).tolist() == list(range(6))


def test_the_task_behind_an_item_is_at_hand(made: Path) -> None:
    dataset = load(made)
    task = task_of(dataset, 2)
    assert np.array_equal(task.trajectory.poses, dataset[2]["poses"].numpy())
    assert dataset.sample(2).plan.found


def test_an_unknown_word_is_refused(made: Path) -> None:
    data = read_dataset(made)
    data.arrays["status"][0] = "guessed"
    with pytest.raises(InvalidProblem, match=r"small status: expected one of optimal, feasible, got guessed"):
        TaskDataset(data)
