import numpy as np
import pytest
import torch

from datasets.motions import TaskSettings
from dlm.structured.features import facet_tokens, gyration, open_range, step_tokens
from dlm.structured.scorer import stack
from dlm.tasks import TaskBatch


def geometry(tasks: TaskBatch, shift: float = 0.0):
    return stack([(s.task.body.vertices, s.task.trajectory.poses + [shift, 0.0, 0.0]) for s in tasks.samples])


def test_the_plate_has_the_inertia_of_its_body(tasks: TaskBatch) -> None:
    expected = [s.task.body.inertia / s.task.body.mass for s in tasks.samples]
    np.testing.assert_allclose(gyration(geometry(tasks)).numpy(), expected, rtol=1e-9)


def test_tokens_do_not_depend_on_where_the_floor_s_origin_is(tasks: TaskBatch) -> None:
    here, there, settings = geometry(tasks), geometry(tasks, 0.4), TaskSettings()
    torch.testing.assert_close(facet_tokens(here, settings), facet_tokens(there, settings))
    torch.testing.assert_close(
        step_tokens(here, settings), step_tokens(there, settings), atol=1e-5, rtol=1e-5
    )


def test_the_open_range_ends_where_the_floor_s_clearance_does() -> None:
    settings = TaskSettings(facet_margin=0.1, clearance=0.005)
    ends = torch.tensor([[0.0, 0.02], [0.02, 0.0], [0.05, 0.06], [0.001, 0.002], [0.0, 0.0]])
    low, high = open_range(ends, settings)
    assert low[:2].tolist() == pytest.approx([0.25, 0.1])
    assert high[:2].tolist() == pytest.approx([0.9, 0.75])
    assert (float(low[2]), float(high[2])) == pytest.approx((0.1, 0.9))
    assert (low > high)[3:].all()  # closed: all of the facet is too near to the floor


def test_contact_with_the_floor_is_told_and_in_which_way_it_slides(tasks: TaskBatch) -> None:
    steps = step_tokens(geometry(tasks), TaskSettings())
    for k, sample in enumerate(tasks.samples):
        touching, sliding = steps[k, :-1, -4], steps[k, :-1, -1]
        moved = np.diff(sample.task.trajectory.poses[:, 0])
        if sample.family == "slide":
            assert touching.all()
            assert np.array_equal(np.sign(sliding.numpy()), np.sign(moved))
        if sample.family == "pivot":
            assert touching.all()
            assert not sliding.any()
        if sample.family.startswith("lift"):
            assert not touching.any()
