"""Panels, and figures or frames written to a file by its suffix."""

import importlib
import importlib.util
import io
import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image
from scipy.spatial import cKDTree

from expert.errors import InvalidProblem
from expert.files.output import write_atomically
from expert.geometry.pose import Array

Image8 = NDArray[np.uint8]

STILL = (".png", ".svg", ".pdf")
MOVING = (".gif", ".mp4")


def suffix(path: str | os.PathLike[str]) -> str:
    """Kind of file that the name asks for.  Raises InvalidProblem for one that cannot be written."""
    ending = Path(path).suffix.lower()
    if ending not in STILL + MOVING:
        raise InvalidProblem(
            "output", expected="a name that ends in " + ", ".join(STILL + MOVING), got=str(path)
        )
    if ending == ".mp4" and not (shutil.which("ffmpeg") or importlib.util.find_spec("cv2")):
        raise InvalidProblem(
            "output",
            expected="ffmpeg or OpenCV to write .mp4",
            got="neither",
            remedy="install one of them or choose .gif",
        )
    return ending


def new_figure(width: float, height: float) -> Figure:
    """An empty figure of the given size in inches, which no global state holds on to."""
    figure = Figure(figsize=(width, height), dpi=100, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def save_figure(figure: Figure, path: str | os.PathLike[str]) -> None:
    """Write a still picture atomically; a .png with a palette, which makes it a fraction of its size."""
    buffer = io.BytesIO()
    ending = suffix(path)
    # No date in the file: the same plan gives the same bytes.
    metadata = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}.get(ending)
    figure.savefig(buffer, format=ending[1:], metadata=metadata)
    if ending == ".png":
        image = np.asarray(Image.open(buffer).convert("RGB"))
        picture = _indexed(image, _palette(image, 256))
        buffer = io.BytesIO()
        picture.save(buffer, "png", optimize=True)
    write_atomically(path, buffer.getvalue())


def pixels(figure: Figure) -> Image8:
    """The figure as an image (height, width, 3)."""
    canvas = figure.canvas
    assert isinstance(canvas, FigureCanvasAgg)  # what new_figure made
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()


def save_frames(frames: Iterable[Image8], path: str | os.PathLike[str], *, rate: float) -> None:
    """Write an animation of the given frames per second atomically."""
    if suffix(path) == ".gif":
        write_atomically(path, _gif(list(frames), rate))
    else:
        write_atomically(path, _mp4([_even(frame) for frame in frames], rate))


def _palette(pixels: Image8, size: int) -> Image8:
    """Colours (size, 3): three quarters of them the commonest, which stay exact; the rest covers the others."""
    codes, counts = np.unique(_codes(pixels), return_counts=True)
    common = _colours(codes[np.argsort(-counts, kind="stable")[: size - size // 4]])
    others = Image.fromarray(pixels).quantize(size // 4, Image.Quantize.MAXCOVERAGE).getpalette() or []
    return np.concatenate([common, np.array(others, dtype=np.uint8).reshape(-1, 3)])[:size]


def _indexed(pixels: Image8, palette: Image8) -> Image.Image:
    """The image with each colour replaced by the nearest of the palette."""
    codes, place = np.unique(_codes(pixels), return_inverse=True)
    nearest = cKDTree(palette.astype(float)).query(_colours(codes).astype(float))[1].astype(np.uint8)
    image = Image.fromarray(nearest[place].reshape(pixels.shape[:2]))
    image.putpalette(palette.ravel().tolist())
    return image


def _codes(pixels: Image8) -> NDArray[np.int64]:
    """One number for each pixel's colour."""
    return pixels.reshape(-1, 3).astype(np.int64) @ np.array([1 << 16, 1 << 8, 1])


def _colours(codes: NDArray[np.int64]) -> Image8:
    return np.stack([codes >> 16, codes >> 8 & 255, codes & 255], axis=-1).astype(np.uint8)


def _gif(frames: Sequence[Image8], rate: float) -> bytes:
    """One palette for all frames keeps flat colours flat and files small."""
    palette = _palette(np.concatenate([frames[0], frames[len(frames) // 2]]), 64)
    images = [_indexed(frame, palette) for frame in frames]
    buffer = io.BytesIO()
    images[0].save(
        buffer,
        "gif",
        save_all=True,
        append_images=images[1:],
        duration=round(1000 / rate),
        loop=0,
        optimize=True,
    )
    return buffer.getvalue()


def _mp4(frames: Sequence[Image8], rate: float) -> bytes:
    write: Callable[[Sequence[Image8], float, str], None] = (
        _write_ffmpeg if shutil.which("ffmpeg") else _write_opencv
    )
    with tempfile.TemporaryDirectory() as folder:
        name = os.path.join(folder, "video.mp4")
        write(frames, rate, name)
        return Path(name).read_bytes()


def _write_ffmpeg(frames: Sequence[Image8], rate: float, name: str) -> None:
    height, width = frames[0].shape[:2]
    source = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", f"{rate:g}", "-i", "-"]
    command = ["ffmpeg", "-loglevel", "error", "-y", *source, "-pix_fmt", "yuv420p", name]
    subprocess.run(command, input=b"".join(frame.tobytes() for frame in frames), check=True)


def _write_opencv(frames: Sequence[Image8], rate: float, name: str) -> None:
    cv2 = importlib.import_module("cv2")  # optional: planning does not depend on OpenCV
    height, width = frames[0].shape[:2]
    writer = cv2.VideoWriter(name, cv2.VideoWriter_fourcc(*"mp4v"), rate, (width, height))
    for frame in frames:
        writer.write(frame[..., ::-1])
    writer.release()


def _even(frame: Image8) -> Image8:
    """Video codecs want even sizes."""
    return np.ascontiguousarray(frame[: len(frame) // 2 * 2, : frame.shape[1] // 2 * 2])


def plain_axes(axes: Axes, low: Array, high: Array) -> None:
    """Equal scales over the box from low to high, no ticks, a thin frame."""
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal")
    axes.set_xticks([])
    axes.set_yticks([])
    for spine in axes.spines.values():
        spine.set_color("#cccccc")


def room_below(low: Array, high: Array) -> tuple[Array, Array]:
    """The box with room for scales below what it shows."""
    return low - [0.0, 0.13 * float((high - low)[0])], high


def square_axes(axes: Axes) -> None:
    """Make a panel's view a square about its middle, so that all panels are of one size."""
    low, high = np.transpose([axes.get_xlim(), axes.get_ylim()])
    middle, half = 0.5 * (low + high), 0.5 * (high - low).max()
    plain_axes(axes, middle - half, middle + half)


def framed_axes(axes: Axes, points: Array, margin: float = 0.06) -> None:
    """Equal scales around points (k, 2), with a margin relative to their extent."""
    low, high = points.min(axis=0), points.max(axis=0)
    pad = margin * float((high - low).max())
    plain_axes(axes, low - pad, high + pad)
