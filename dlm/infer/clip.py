"""Video files: the few frames that stand for a motion."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import cv2
import numpy as np

from datasets.limits import Number, check_numbers
from datasets.render import Frames
from dlm.perception.video import check_frames
from expert.errors import InvalidProblem
from expert.geometry.pose import Array
from expert.world.values import readonly, require

os.environ.setdefault(
    "OPENCV_FFMPEG_LOGLEVEL", "-8"
)  # what FFmpeg would say of a bad file we say in one line


@dataclass(frozen=True, kw_only=True)
class Clip:
    """frames (n, height, width, 3) uint8 RGB, at times (n,) [s], the first at 0; n >= 2."""

    frames: Frames
    times: Array

    def __post_init__(self) -> None:
        check_frames(self.frames)
        times = readonly(self.times, (None,), "times")
        rising = len(times) == len(self.frames) and bool(np.all(np.diff(times) > 0))
        require(rising, "times", f"{len(self.frames)} rising times, one for each frame", times.tolist())
        object.__setattr__(self, "times", times - times[0])

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
    start: Annotated[float, Number(unit="seconds", least=0)] = 0.0
    end: Annotated[float | None, Number(unit="seconds", above=0)] = None
    rate: Annotated[float | None, Number(unit="frames per second", above=0, most=1e5)] = None

    def __post_init__(self) -> None:
        check_numbers(self)
        require(isinstance(self.path, str | Path), "video", "the name of a file", self.path)


def read_clip(video: str | Path | VideoFile, *, steps: int) -> Clip:
    """The frames nearest to `steps` equally spaced times, each frame once, with square pixels.

    Every frame counts at its own time stamp, whatever the file's mean rate is.  Raises InvalidProblem for what is no video,
    holds fewer than two frames, or not the times asked for.
    """
    file = video if isinstance(video, VideoFile) else VideoFile(path=video)
    require(Path(file.path).is_file(), "video", "a file", f"{file.path}, which is none")
    times = _times(file)
    last, gap = float(times[-1]), float(np.median(np.diff(times)))
    end = last if file.end is None else file.end
    require(0 <= file.start < end, "start", f"a time before the end, {end:g} s", file.start)
    require(end < last + gap, "end", f"a time within the clip, up to {last:g} s", end)
    wanted = np.linspace(file.start, min(end, last), steps)
    chosen = np.unique(np.abs(times[:, None] - wanted).argmin(axis=0))
    require(len(chosen) >= 2, "video", "at least 2 frames between start and end", len(chosen), "widen them")
    return Clip(frames=_read(file.path, chosen), times=times[chosen] - times[chosen[0]])


def _times(file: VideoFile) -> Array:
    """When each frame that can be decoded is shown (n,) [s], the first at 0.  The stated count of frames is not to be trusted."""
    video, stamps = _open(file.path), []
    if not video.isOpened():
        raise InvalidProblem(
            "video",
            expected="a file that OpenCV can decode",
            got=str(file.path),
            remedy="convert it to mp4 or avi",
        )
    try:
        while video.grab():
            stamps.append(1e-3 * video.get(cv2.CAP_PROP_POS_MSEC))
        rate = float(video.get(cv2.CAP_PROP_FPS)) if file.rate is None else file.rate
    finally:
        video.release()
    count, times = len(stamps), np.array(stamps) - (stamps[0] if stamps else 0.0)
    require(
        count >= 2,
        "video",
        "at least 2 frames",
        f"{count} in {file.path}",
        "a motion needs more than a picture" if count else "the file holds no frame that can be decoded",
    )
    if file.rate is None and np.all(np.diff(times) > 0):
        return times
    require(0 < rate < 1e5, "rate", "frames per second", rate, "the file does not say: give rate=")
    return np.arange(count) / rate


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
        across, down = video.get(cv2.CAP_PROP_SAR_NUM), video.get(cv2.CAP_PROP_SAR_DEN)
        for k in range(int(chosen[-1]) + 1):
            video.grab()
            if k in wanted:
                ok, image = video.retrieve()
                require(ok, "video", "frames that can be decoded", f"a damaged frame {k} in {path}")
                frames.append(cv2.cvtColor(image, cv2.COLOR_BGR2RGB))
    finally:
        video.release()
    return np.stack([_squared(frame, across / down if across > 0 < down else 1.0) for frame in frames])


def _squared(frame: np.ndarray, ratio: float) -> np.ndarray:
    """With square pixels: as high as it was, and as many times as wide as its pixels are wider than high."""
    height, width = frame.shape[:2]
    wide = round(width * ratio)
    if wide == width:
        return frame
    way = cv2.INTER_AREA if wide < width else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(frame, (wide, height), interpolation=way))
