from dataclasses import replace

import numpy as np
import pytest

from datasets.render import Palette, render
from dlm.infer import Clip, Given, infer
from dlm.infer.view import find_floor, view_of
from dlm.tasks import TaskBatch
from tests.support.clips import CAMERA, SCALE, SIZE, drawn

KNOWN = Given(scale=SCALE)


def test_a_wide_video_is_cut_to_the_motion(tasks: TaskBatch) -> None:
    sample = tasks.samples[1]
    frames = drawn(sample.task.body.vertices, sample.task.trajectory.poses)
    wide = np.concatenate([np.repeat(frames[:, :, :1], 200, axis=2), frames], axis=2)
    view = view_of(wide, scale=SCALE, floor=180.0, extent=28.0)
    assert view.camera.size < 80
    answer = infer(Clip(frames=wide, times=0.1 * np.arange(5)), KNOWN)
    poses = answer.planned.perceived.poses - [
        0.1,
        0,
        0,
    ]  # the middle of the picture is 100 pixels further left
    assert np.abs(poses - sample.task.trajectory.poses).max() < 5e-3


def test_the_floor_is_found_to_a_part_of_a_pixel(tasks: TaskBatch) -> None:
    sample = tasks.samples[0]
    for below in (0.0203, 0.0207):
        camera = replace(CAMERA, below=below)
        frames = render(sample.task.body.vertices, sample.task.trajectory.poses, camera)
        assert find_floor(frames) == pytest.approx(SIZE - below / SCALE, abs=0.05)
    assert find_floor(np.full((2, 50, 50, 3), 200, dtype=np.uint8)) is None


def test_a_floor_that_cannot_be_seen_is_where_the_object_stands(tasks: TaskBatch) -> None:
    sample, plain = tasks.samples[0], Palette(ground=Palette().background)
    frames = drawn(sample.task.body.vertices, sample.task.trajectory.poses, plain)
    answer = infer(Clip(frames=frames, times=0.1 * np.arange(5)), KNOWN)
    assert answer.view.floor == pytest.approx(180, abs=2)
    assert answer.follows
