import numpy as np
import pytest

from dlm.perception import Perceived
from dlm.structured import StructuredModel
from dlm.structured.calibration import NAMES, Calibration, deflated
from dlm.tasks import TaskBatch
from expert.errors import InvalidProblem
from expert.geometry.pose import Array, to_world
from tests.support.structured import seen_by_label


def blown_up(vertices: Array, distance: float) -> Array:
    """Every side moved out."""
    edge = np.roll(vertices, -1, axis=0) - vertices
    normal = np.stack([edge[:, 1], -edge[:, 0]], -1) / np.linalg.norm(edge, axis=1, keepdims=True)
    before = np.roll(normal, 1, axis=0)
    return vertices + distance * (normal + before) / (1 + (normal * before).sum(1, keepdims=True))


@pytest.mark.parametrize("k", range(4))
def test_deflating_what_was_blown_up_gives_the_object_back_with_its_contacts(
    tasks: TaskBatch, k: int
) -> None:
    distance, true = 5e-4, seen_by_label(tasks, k)
    vertices = blown_up(true.vertices, distance)
    poses = true.poses.copy()
    heights = to_world(poses, vertices)[..., 1].min(axis=1)
    resting = to_world(true.poses, true.vertices)[..., 1].min(axis=1) < 1e-6
    poses[resting, 1] -= heights[resting]  # perception lets it touch
    back = deflated(Perceived(vertices=vertices, poses=poses, residual=0.0, noise=0.0), distance)
    np.testing.assert_allclose(back.vertices, true.vertices, atol=1e-9)
    np.testing.assert_allclose(back.poses[:, [0, 2]], true.poses[:, [0, 2]], atol=1e-9)
    np.testing.assert_allclose(back.poses[resting, 1], true.poses[resting, 1], atol=1e-9)


def test_calibration_changes_what_it_names_and_stays_sensible() -> None:
    model = StructuredModel()
    assert model.calibrated(Calibration()) == model
    for name in NAMES:
        assert model.calibrated(Calibration(**{name: 1e-3})) != model
    wild = model.calibrated(Calibration.of(np.full(len(NAMES), 1e3)))
    assert wild.planning.tasks.facet_margin <= 0.45
    assert wild.planning.tasks.cone_fraction <= 1
    with pytest.raises(InvalidProblem, match=r"calibration\.blur"):
        Calibration(blur=np.nan)
