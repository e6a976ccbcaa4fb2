"""Frames in memory go the way of a file."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from certmanip.cases import case
from certmanip.video import infer
from expert.errors import InvalidProblem

CLIP = Path(__file__).resolve().parents[2] / "docs/examples/pivot_lift.mp4"


def frames() -> np.ndarray:
    video, read = cv2.VideoCapture(str(CLIP)), []
    while (found := video.read())[0]:
        read.append(found[1][..., ::-1])
    return np.stack(read)


@pytest.mark.slow
def test_an_array_is_planned_like_its_file() -> None:
    by_array, by_file = infer(frames(), fps=10, scale=0.001), infer(CLIP, scale=0.001)
    assert by_array.status == "planned"
    assert by_array.plan is not None
    assert by_file.plan is not None
    np.testing.assert_allclose(by_array.plan.forces, by_file.plan.forces, atol=1e-9)
    assert case(by_array.solution()).verify().verdict == "sound"


@pytest.mark.parametrize(
    ("video", "options", "words"),
    [
        (np.zeros((3, 8, 8, 3), np.uint8), {"scale": 1.0}, "fps: expected frames per second, got None"),
        (np.zeros((3, 8, 8, 3), np.uint8), {"scale": 1.0, "fps": -1}, "fps: "),
        (np.zeros((3, 8, 8, 3)), {"scale": 1.0, "fps": 1}, "video: expected uint8"),
        (np.zeros((8, 8, 3), np.uint8), {"scale": 1.0, "fps": 1}, r"video: expected an array \(T"),
        (np.zeros((3, 8, 8, 3), np.uint8), {"fps": 1}, "scale: .*got neither"),
        ("nowhere.mp4", {"scale": 1.0}, "video: expected a file"),
    ],
)
def test_what_is_wrong_is_one_line(video: object, options: dict[str, float], words: str) -> None:
    with pytest.raises(InvalidProblem, match=words):
        infer(video, **options)  # type: ignore[arg-type]
