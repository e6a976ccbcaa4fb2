from pathlib import Path

import numpy as np
import pytest

from dlm.infer import VideoFile, read_clip
from tests.support.clips import write_clip


def test_frames_are_taken_at_equally_spaced_times(tmp_path: Path) -> None:
    grey = np.arange(0, 210, 10, dtype=np.uint8)
    frames = np.broadcast_to(grey[:, None, None, None], (21, 32, 48, 3))
    path = write_clip(tmp_path / "grey.mp4", frames, rate=20.0)
    clip = read_clip(path, steps=5)
    assert clip.times.tolist() == pytest.approx([0, 0.25, 0.5, 0.75, 1.0])
    np.testing.assert_allclose(clip.frames.mean(axis=(1, 2, 3)), grey[::5], atol=4.5)
    part = read_clip(VideoFile(path=path, start=0.5, end=0.7), steps=3)
    np.testing.assert_allclose(part.frames.mean(axis=(1, 2, 3)), [100, 120, 140], atol=4.5)
    assert read_clip(VideoFile(path=path, rate=10.0), steps=5).duration == pytest.approx(2.0)
