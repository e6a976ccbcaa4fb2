"""Files with frames of their own times and shapes: GIF by Pillow; mp4 and Matroska by OpenCV, their time stamps edited."""

import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from dlm.infer import Clip, VideoFile, read_clip
from expert.errors import InvalidProblem
from tests.support.clips import write_clip

GREY = np.array([10, 60, 110, 160, 210, 250], dtype=np.uint8)
LATER = [0.0, 0.02, 0.04, 0.06, 0.16, 0.26]
"""Times of six frames, the first ones close together [s]."""


def plain(grey: np.ndarray, height: int = 40, width: int = 60) -> np.ndarray:
    """Frames of one grey level each."""
    return np.broadcast_to(grey[:, None, None, None], (len(grey), height, width, 3))


def test_frames_are_taken_at_equally_spaced_times(tmp_path: Path) -> None:
    grey = np.arange(0, 210, 10, dtype=np.uint8)
    path = write_clip(tmp_path / "grey.mp4", plain(grey, 32, 48), rate=20.0)
    clip = read_clip(path, steps=5)
    assert clip.times.tolist() == pytest.approx([0, 0.25, 0.5, 0.75, 1.0])
    np.testing.assert_allclose(clip.frames.mean(axis=(1, 2, 3)), grey[::5], atol=4.5)
    part = read_clip(VideoFile(path=path, start=0.5, end=0.7), steps=3)
    np.testing.assert_allclose(part.frames.mean(axis=(1, 2, 3)), [100, 120, 140], atol=4.5)
    assert read_clip(VideoFile(path=path, rate=10.0), steps=5).duration == pytest.approx(2.0)


def gif(path: Path) -> Path:
    pictures = [Image.fromarray(frame) for frame in plain(GREY)]
    pauses = [round(1e3 * (b - a)) for a, b in zip(LATER, [*LATER[1:], 0.36], strict=True)]
    pictures[0].save(path, save_all=True, append_images=pictures[1:], duration=pauses)
    return path


def mp4(path: Path) -> Path:
    """An even mp4 whose table of durations is written anew: of 12800 ticks a second, 256 and 1280 a frame."""
    data = write_clip(path, plain(GREY), rate=50.0).read_bytes()
    at = data.index(b"stts")
    assert struct.unpack(">4I", data[at + 4 : at + 20])[1:3] == (1, 6)
    (ticks,) = struct.unpack(">I", data[at + 16 : at + 20])
    table = struct.pack(">6I", 0, 2, 3, ticks, 3, 5 * ticks)
    out = data[: at + 4] + table + data[at + 20 :]
    for box in (b"stts", b"stbl", b"minf", b"mdia", b"trak", b"moov"):  # all boxes around it grow
        place = out.index(box) - 4
        (size,) = struct.unpack(">I", out[place : place + 4])
        out = out[:place] + struct.pack(">I", size + 8) + out[place + 4 :]
    edit = out.index(b"elst") + 12  # what is shown of it: more than there is
    path.write_bytes(out[:edit] + struct.pack(">I", 10_000) + out[edit + 4 :])
    return path


def mkv(path: Path) -> Path:
    """An even Matroska file (pictures of their own, 20 ms apart) whose blocks get other times."""
    data = write_clip(path, plain(GREY), rate=50.0, codec="MJPG").read_bytes()
    for k in range(len(GREY) - 1, 2, -1):
        before, after = (b"\x81" + struct.pack(">h", t) + b"\x80" for t in (20 * k, round(1e3 * LATER[k])))
        assert data.count(before) == 1
        data = data.replace(before, after)
    path.write_bytes(data)
    return path


@pytest.mark.parametrize("make", [gif, mp4, mkv])
def test_every_frame_counts_at_its_own_time(make: Callable[[Path], Path], tmp_path: Path) -> None:
    path = make(tmp_path / f"uneven.{make.__name__}")
    clip = read_clip(path, steps=14)
    assert clip.times.tolist() == pytest.approx(LATER, abs=1e-3)
    few = read_clip(path, steps=3)  # at 0, 0.13 and 0.26 s
    assert few.times.tolist() == pytest.approx([0, 0.16, 0.26], abs=1e-3)
    np.testing.assert_allclose(few.frames.mean(axis=(1, 2, 3)), GREY[[0, 4, 5]], atol=4.5)
    told = read_clip(VideoFile(path=path, rate=10.0), steps=6)
    assert told.times.tolist() == pytest.approx([0, 0.1, 0.2, 0.3, 0.4, 0.5])


@pytest.mark.parametrize(("byte", "ratio"), [(113, 2.0), (17, 0.5), (49, 1.0), (0, 1.0)])
def test_pixels_are_made_square(byte: int, ratio: float, tmp_path: Path) -> None:
    """A GIF states its pixels' width over height as (byte + 15) / 64, or not at all: 0."""
    data = bytearray(gif(tmp_path / "shape.gif").read_bytes())
    data[12] = byte
    (tmp_path / "shape.gif").write_bytes(data)
    clip = read_clip(tmp_path / "shape.gif", steps=3)
    assert clip.frames.shape == (3, 40, round(60 * ratio), 3)
    np.testing.assert_allclose(clip.frames.mean(axis=(1, 2, 3)), GREY[[0, 4, 5]], atol=4.5)


def test_times_that_are_not_there_are_refused(tmp_path: Path) -> None:
    path = gif(tmp_path / "uneven.gif")
    for file, words in (
        (VideoFile(path=path, start=0.3), "start: expected a time before the end, 0.26 s"),
        (VideoFile(path=path, end=0.4), "end: expected a time within the clip, up to 0.26 s"),
        (
            VideoFile(path=path, start=0.061, end=0.1),
            "video: expected at least 2 frames between start and end",
        ),
    ):
        with pytest.raises(InvalidProblem, match=words):
            read_clip(file, steps=5)


RGB = plain(GREY)
BAD = {
    "greyscale": ({"frames": RGB[..., 0]}, r"video: expected an array \(T, height, width, 3\), got shape \(6, 40, 60\)"),
    "float": ({"frames": RGB / 255}, "video: expected uint8 grey levels from 0 to 255, got float64"),
    "a list": ({"frames": [1, 2]}, r"video: expected an array .*, got list"),
    "one frame": ({"frames": RGB[:1], "times": [0.0]}, "video: expected at least 2 frames, got 1"),
    "too few times": ({"times": LATER[:5]}, "times: expected 6 rising times, one for each frame, got"),
    "falling times": ({"times": LATER[::-1]}, "times: expected 6 rising times"),
    "no times": ({"times": None}, "times: expected numbers"),
    "nan": ({"times": [*LATER[:5], np.nan]}, "times: expected finite numbers"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_a_clip_is_rgb_frames_with_their_times(name: str) -> None:
    changed, words = BAD[name]
    with pytest.raises(InvalidProblem, match=words) as refusal:
        Clip(**{"frames": RGB, "times": np.array(LATER), **changed})  # type: ignore[arg-type]
    assert "\n" not in str(refusal.value)
    assert Clip(frames=RGB, times=np.array(LATER) + 7).times.tolist() == pytest.approx(LATER)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("start", -1.0),
        ("start", "soon"),
        ("end", 0),
        ("end", np.nan),
        ("rate", 0),
        ("rate", -1.0),
        ("rate", True),
    ],
)
def test_times_of_a_file_are_numbers(field: str, value: object) -> None:
    with pytest.raises(InvalidProblem, match=f"^{field}: expected a .*number of .*, got"):
        VideoFile(path="x.mp4", **{field: value})  # type: ignore[arg-type]
