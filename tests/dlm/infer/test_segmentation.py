from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from datasets.render import Palette
from dlm.infer import Clip, Given, Segmentation, infer
from dlm.tasks import TaskBatch
from expert.errors import InvalidProblem
from tests.support.clips import SCALE, drawn

KNOWN = Given(scale=SCALE)


@pytest.mark.parametrize("way", ["colour", "background"])
def test_an_object_before_a_patterned_wall_is_told_apart(tasks: TaskBatch, tmp_path: Path, way: str) -> None:
    sample = tasks.samples[0]
    rng = np.random.default_rng(0)
    pattern = np.kron(rng.integers(40, 220, (20, 20, 1)), np.ones((10, 10, 3))).astype(np.uint8)
    pattern[180:] = (60, 80, 100)
    frames = drawn(sample.task.body.vertices, sample.task.trajectory.poses)
    empty = drawn(sample.task.body.vertices, sample.task.trajectory.poses + [0, 5, 0])
    inside = np.linalg.norm(frames.astype(float) - empty, axis=-1, keepdims=True) > 40
    clip = Clip(frames=np.where(inside, frames, pattern), times=0.1 * np.arange(5))
    Image.fromarray(pattern).save(tmp_path / "empty.png")
    told = (
        Segmentation(colour=Palette().object)
        if way == "colour"
        else Segmentation(background=tmp_path / "empty.png")
    )
    answer = infer(clip, replace(KNOWN, floor=180.0), segmentation=told)
    error = np.abs(answer.planned.perceived.poses - sample.task.trajectory.poses).max(axis=0)
    assert np.all(error < [1e-3, 1e-3, np.deg2rad(1.5)])
    assert answer.follows


def test_a_segmentation_takes_one_way(tmp_path: Path) -> None:
    with pytest.raises(InvalidProblem, match="both"):
        Segmentation(colour=(1, 2, 3), background="x.png")
    with pytest.raises(InvalidProblem, match="three integers"):
        Segmentation(colour=(1, 2, 300))
    with pytest.raises(InvalidProblem, match="a picture"):
        Segmentation(background=tmp_path / "none.png").mask(np.zeros((2, 9, 9, 3), dtype=np.uint8))
