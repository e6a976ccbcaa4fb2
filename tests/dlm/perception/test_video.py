import numpy as np
import pytest

from datasets.render import Camera
from dlm.perception.video import check_video
from expert.errors import InvalidProblem

GOOD = np.zeros((2, 50, 50, 3), np.uint8)

BAD = {
    "grey": (GOOD[..., 0], r"an array \(T, height, width, 3\), got shape \(2, 50, 50\)"),
    "with alpha": (np.zeros((2, 50, 50, 4), np.uint8), r"got shape \(2, 50, 50, 4\)"),
    "a list": (GOOD.tolist(), "got list"),
    "float": (GOOD / 255, "uint8 grey levels from 0 to 255, got float64"),
    "nan": (GOOD * np.nan, "got float64 with nan or inf"),
    "one frame": (GOOD[:1], "at least 2 frames, got 1"),
    "another size": (
        np.zeros((2, 40, 60, 3), np.uint8),
        "frames of 50 x 50 pixels as the camera's, got 60 x 40",
    ),
}


def test_frames_of_the_camera_pass() -> None:
    check_video(GOOD, Camera())


@pytest.mark.parametrize("name", BAD)
def test_anything_else_is_refused_by_what_it_is(name: str) -> None:
    video, message = BAD[name]
    with pytest.raises(InvalidProblem, match=f"^video: expected .*{message}"):
        check_video(video, Camera())  # type: ignore[arg-type]
