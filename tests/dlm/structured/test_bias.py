import numpy as np
import pytest

from datasets.render import Camera
from dlm.perception import perceive
from dlm.structured.bias import STATED, Bias
from dlm.structured.calibration import Calibration
from dlm.structured.model import StructuredModel
from dlm.tasks import TaskBatch
from expert.errors import InvalidProblem
from expert.geometry.polygon import signed_area
from expert.geometry.pose import to_world


def test_an_unbiased_camera_shows_what_the_data_set_holds(tasks: TaskBatch) -> None:
    seen = Bias().videos(tasks, Camera())
    assert (seen.video == tasks.video).all()
    assert all((s.video == v.numpy()).all() for s, v in zip(seen.samples, tasks.video, strict=True))
    assert (STATED.videos(tasks, Camera()).video != tasks.video).any()


def test_knobs_at_the_stated_bias_undo_it(tasks: TaskBatch) -> None:
    """Seen through the calibrated model, the object is where it is and as large as it is, within a tenth of a pixel."""
    sample = tasks.samples[2]
    video = STATED.video(sample.task.body, sample.task.trajectory.poses, Camera())
    known = Calibration(
        shift_x=STATED.shift_x, shift_y=STATED.shift_y, inflation=STATED.inflation, blur=STATED.blur
    )
    model = StructuredModel().calibrated(known)
    planned = model.act(video)
    assert planned.task is not None
    errors = planned.task.trajectory.poses - sample.task.trajectory.poses
    assert np.abs(errors[:, :2]).max() < 4e-4
    plain = perceive(video)
    assert np.abs(plain.poses - sample.task.trajectory.poses)[:, 0].max() > 1.5e-3
    area = signed_area(planned.task.body.vertices) / signed_area(sample.task.body.vertices)
    assert area == pytest.approx(1.0, abs=0.03)
    assert signed_area(plain.vertices) / signed_area(sample.task.body.vertices) > 1.02
    assert to_world(planned.task.trajectory.poses, planned.task.body.vertices)[..., 1].min() >= -1e-9


@pytest.mark.parametrize(("name", "value"), [("shift_x", np.nan), ("inflation", -1e-3), ("blur", 6.0)])
def test_impossible_cameras_are_refused(name: str, value: float) -> None:
    with pytest.raises(InvalidProblem, match=f"bias.{name}"):
        Bias(**{name: value})
