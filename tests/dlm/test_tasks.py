from pathlib import Path

import numpy as np
import pytest
import torch

from dlm.tasks import TaskBatch, first, read_all
from expert.errors import InvalidProblem


def test_a_batch_holds_what_its_samples_hold(tasks: TaskBatch) -> None:
    for k, sample in enumerate(tasks.samples):
        assert np.array_equal(tasks.video[k].numpy(), sample.video)
        assert np.array_equal(tasks.positions[k].numpy(), sample.plan.positions)
        assert np.array_equal(tasks.poses[k].numpy(), sample.task.trajectory.poses)
        assert float(tasks.weight[k]) == pytest.approx(sample.task.body.mass * 9.81)
        assert np.array_equal(tasks.parameters.wrench[k].numpy(), sample.parameters.wrench)


def test_some_of_the_tasks_keep_all_that_belongs_to_them(tasks: TaskBatch) -> None:
    some = tasks[torch.tensor([2, 0])]
    assert [s.index for s in some.samples] == [2, 0]
    assert torch.equal(some.video, tasks.video[[2, 0]])
    assert torch.equal(some.poses, tasks.poses[[2, 0]])
    assert torch.equal(some.parameters.facets, tasks.parameters.facets[[2, 0]])
    assert some.fingerprint == tasks.fingerprint


def test_a_folder_named_twice_is_read_once_and_only_the_training_set_is_cut(data_folder: Path) -> None:
    folder = data_folder / "data" / "smoke-seed0"
    read = read_all({"train": folder, "test": folder, "family": folder}, train_tasks=2)
    assert [len(batch) for batch in read.values()] == [2, 4, 4]
    assert read["test"] is read["family"]


def test_the_first_so_many_tasks_are_taken(tasks: TaskBatch) -> None:
    assert [len(first({"a": tasks}, most)["a"]) for most in (2, 3, 9, None)] == [2, 3, 4, 4]
    with pytest.raises(InvalidProblem, match="tasks: expected a number of at least 2, got 0"):
        first({"a": tasks}, 0)


@pytest.mark.parametrize("count", [1, 5, 2.5])
def test_a_data_set_has_no_more_tasks_than_it_has(data_folder: Path, count: int) -> None:
    with pytest.raises(InvalidProblem, match="train_tasks: expected a whole number from 2 to 4"):
        TaskBatch.read(data_folder / "data" / "smoke-seed0", count)
    with pytest.raises(InvalidProblem, match="at least one task"):
        TaskBatch.of([])
