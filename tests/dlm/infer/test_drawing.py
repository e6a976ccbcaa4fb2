from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from datasets.specification import Sample
from dlm.infer import Given, Inference, infer
from dlm.infer.drawing import draw_inference
from dlm.tasks import TaskBatch
from tests.support.clips import SCALE, drawn, write_clip

KNOWN = Given(scale=SCALE)


@pytest.fixture(scope="module")
def clips(tasks: TaskBatch, tmp_path_factory: pytest.TempPathFactory) -> list[tuple[Sample, Path]]:
    folder = tmp_path_factory.mktemp("clips")
    return [
        (s, write_clip(folder / f"{s.index}.mp4", drawn(s.task.body.vertices, s.task.trajectory.poses)))
        for s in tasks.samples
    ]


@pytest.fixture(scope="module")
def answers(clips: list[tuple[Sample, Path]]) -> list[Inference]:
    return [infer(path, KNOWN) for _, path in clips]


def test_the_animation_shows_video_and_simulation(answers: list[Inference], tmp_path: Path) -> None:
    draw_inference(answers[2], tmp_path / "motion.gif")
    with Image.open(tmp_path / "motion.gif") as film:
        assert film.n_frames == 41
        film.seek(0)
        first = np.array(film.convert("RGB")).astype(int)
        film.seek(40)
        last = np.array(film.convert("RGB")).astype(int)
    for half in (slice(0, 420), slice(420, 840)):  # both the video and the simulated object move
        assert (np.abs(first[:, half] - last[:, half]).max(axis=-1) > 60).sum() > 500
