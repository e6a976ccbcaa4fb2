from dataclasses import replace

import pytest

from dlm.structured import Planning, StructuredModel
from dlm.tasks import TaskBatch
from expert.errors import InvalidProblem
from expert.geometry.pose import to_world
from tests.support.structured import seen_by_label


def test_another_number_of_frames_is_refused(tasks: TaskBatch) -> None:
    with pytest.raises(InvalidProblem, match="poses: expected 5, got 4; resample"):
        StructuredModel().plan(replace(seen_by_label(tasks, 0), poses=seen_by_label(tasks, 0).poses[:4]))


def test_margins_are_given_up_before_pushes_get_firmer() -> None:
    own = Planning()
    variants = list(own.variants())
    assert variants[0] == own
    margins = [v.tasks.facet_margin for v in variants]
    assert margins[:6] == [0.2, 0.2, 0.1, 0.1, 0.05, 0.05]
    assert {v.tasks.least_push for v in variants[:6]} == {own.tasks.least_push, 0.0}
    assert all(v.tasks.facet_margin == own.tasks.facet_margin for v in variants[6:])
    assert all(v.tasks.least_push >= own.tasks.least_push for v in variants[6:])


def test_what_is_seen_below_the_floor_is_lifted_on_it(tasks: TaskBatch) -> None:
    seen = seen_by_label(tasks, 0)
    sunk = replace(seen, poses=seen.poses - [0.0, 1e-3, 0.0])
    task = Planning().of(sunk)
    heights = to_world(task.trajectory.poses, task.body.vertices)[..., 1]
    assert heights.min() == pytest.approx(0.0, abs=1e-12)
    assert task.body.mass == Planning().tasks.mass
