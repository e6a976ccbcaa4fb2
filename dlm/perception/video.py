"""What counts as a video."""

import numpy as np

from datasets.render import Camera, Frames
from expert.errors import InvalidProblem


def check_video(video: Frames, camera: Camera) -> None:
    """Raises InvalidProblem unless this is a video for that camera."""
    check_frames(video)
    if video.shape[1:3] != (camera.size, camera.size):
        raise InvalidProblem(
            "video",
            expected=f"frames of {camera.size} x {camera.size} pixels as the camera's",
            got=f"{video.shape[2]} x {video.shape[1]}",
            remedy="resize the frames or give their camera",
        )


def check_frames(video: Frames) -> None:
    """Raises InvalidProblem unless these are two RGB frames at least."""
    if not isinstance(video, np.ndarray) or video.ndim != 4 or video.shape[-1] != 3:
        got = f"shape {video.shape}" if isinstance(video, np.ndarray) else type(video).__name__
        raise InvalidProblem(
            "video", expected="an array (T, height, width, 3)", got=got, remedy="give RGB frames"
        )
    if video.dtype != np.uint8:
        bad = np.issubdtype(video.dtype, np.floating) and not np.isfinite(video).all()
        raise InvalidProblem(
            "video",
            expected="uint8 grey levels from 0 to 255",
            got=f"{video.dtype}" + (" with nan or inf" if bad else ""),
            remedy="round to whole numbers and convert",
        )
    if len(video) < 2:
        raise InvalidProblem(
            "video", expected="at least 2 frames", got=f"{len(video)}", remedy="give a longer clip"
        )
