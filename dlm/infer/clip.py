"""Video files: the few frames that stand for a motion."""

import os
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from datasets.render import Frames
from expert.errors import InvalidProblem
from expert.geometry.pose import Array
from expert.world.values import require

os.environ.setdefault(
    "OPENCV_FFMPEG_LOGLEVEL", "-8"
)  # what FFmpeg would say of a bad file we say in one line


@dataclass(frozen=True, kw_only=True)
class Clip:
    """frames (n, height, width, 3) uint8 RGB, at times (n,) [s], the first at 0; n >= 2."""

    frames: Frames
    times: Array

    @property
    def duration(self) -> float:
        """[s]"""
        return float(self.times[-1])


@dataclass(frozen=True, kw_only=True)
class VideoFile:
    """A video file, or its part from `start` to `end` [s]; None: to its last frame.

    rate: frames per second, where the file does not say or says wrongly.
    """

    path: str | Path
    start: float = 0.0
    end: float | None = None
    rate: float | None = None


def read_clip(video: str | Path | VideoFile, *, steps: int) -> Clip:
    """The frames nearest to `steps` equally spaced times, each frame once.

    Raises InvalidProblem for what is no video, holds fewer than two frames, or not the times asked for.
    """
    file = video if isinstance(video, VideoFile) else VideoFile(path=video)
    path, start, end, rate = file.path, file.start, file.end, file.rate
    require(Path(path).is_file(), "video", "a file", f"{path}, which is none")
    count, stated = _measure(path)
    rate = stated if rate is None else rate
    require(0 < rate < 1e5, "rate", "frames per second", rate, "the file does not say: give rate=")
    last = (count - 1) / rate
    end = last if end is None else end
    require(0 <= start < end, "start", f"a time before the end, {end:g} s", start)
    require(end < last + 1 / rate, "end", f"a time within the clip, up to {last:g} s", end)
    chosen = np.unique(np.rint(np.linspace(start, min(end, last), steps) * rate).astype(int))
    require(len(chosen) >= 2, "video", "at least 2 frames between start and end", len(chosen), "widen them")
    return Clip(frames=_read(path, chosen), times=(chosen - chosen[0]) / rate)


def _measure(path: str | Path) -> tuple[int, float]:
    """Frames that can be decoded, and the stated rate.  The stated count is not to be trusted."""
    video = _open(path)
    if not video.isOpened():
        raise InvalidProblem(
            "video",
            expected="a file that OpenCV can decode",
            got=str(path),
            remedy="convert it to mp4 or avi",
        )
    try:
        count = 0
        while video.grab():
            count += 1
        rate = float(video.get(cv2.CAP_PROP_FPS))
    finally:
        video.release()
    require(
        count >= 2,
        "video",
        "at least 2 frames",
        f"{count} in {path}",
        "a motion needs more than a picture" if count else "the file holds no frame that can be decoded",
    )
    return count, rate


def _open(path: str | Path) -> cv2.VideoCapture:
    """Without OpenCV's own words on standard error."""
    level = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        return cv2.VideoCapture(str(path))
    finally:
        cv2.utils.logging.setLogLevel(level)


def _read(path: str | Path, chosen: np.ndarray) -> Frames:
    """Decoded frames of the given numbers, in order; the others pass by without filling the memory."""
    video, frames, wanted = _open(path), [], set(chosen.tolist())
    try:
        for k in range(int(chosen[-1]) + 1):
            video.grab()
            if k in wanted:
                ok, image = video.retrieve()
                require(ok, "video", "frames that can be decoded", f"a damaged frame {k} in {path}")
                frames.append(cv2.cvtColor(image, cv2.COLOR_BGR2RGB))
    finally:
        video.release()
    return np.stack(frames)
