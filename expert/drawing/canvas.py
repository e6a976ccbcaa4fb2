"""What all pictures share: colours, panels, and figures or frames written to a file by its suffix."""

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

from expert.errors import InvalidProblem
from expert.files.output import write_atomically
from expert.geometry.pose import Array, perpendicular
from expert.world.walls import HalfPlane

Image8 = NDArray[np.uint8]

STILL = (".png", ".svg", ".pdf")
MOVING = (".gif", ".mp4")
OBJECT, EDGE, WALL = "#d9d2c5", "#4a4338", "#b8bcc2"
FINGER, FINGER_FORCE, REACTION = "#c8102e", "#1a8a3c", "#1f5fbf"
"""Red fingers, green finger forces, blue reactions, as in the thesis's Fig. 3-6."""


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


def save_figure(figure: Figure, path: str | os.PathLike[str], *, colours: int | None = None) -> None:
    """Write a still picture atomically; a .png with a palette of at most `colours` <= 256, which makes it smaller."""
    buffer = io.BytesIO()
    ending = suffix(path)
    # No date in the file: the same plan gives the same bytes.
    metadata = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}.get(ending)
    figure.savefig(buffer, format=ending[1:], metadata=metadata)
    if colours and ending == ".png":
        picture = Image.open(buffer).convert("RGB").quantize(colours, dither=Image.Dither.NONE)
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


def _gif(frames: Sequence[Image8], rate: float) -> bytes:
    """One palette for all frames, and no dithering, keep flat colours flat and files small."""
    images = [Image.fromarray(frame) for frame in frames]
    palette = Image.fromarray(np.concatenate([frames[0], frames[len(frames) // 2]])).quantize(64)
    images = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
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


def closed(points: Array) -> Array:
    """Corners (k, 2) of a polygon with the first one repeated."""
    return np.concatenate([points, points[:1]])


def scale_bar(axes: Axes) -> None:
    """A bar of 1, 2 or 5 times a power of ten, about a quarter of the picture wide, with its length in mm below the picture."""
    (left, right), bottom = axes.get_xlim(), axes.get_ylim()[0]
    width = right - left
    lengths = np.outer([1, 2, 5], 10.0 ** np.arange(-7, 3)).ravel()
    length = float(lengths[lengths <= 0.3 * width].max())
    y = bottom + 0.035 * width
    ends = (left + 0.04 * width, left + 0.04 * width + length)
    axes.plot(ends, (y, y), color=EDGE, lw=2.5, solid_capstyle="butt", zorder=8)
    axes.text(
        sum(ends) / 2, y + 0.02 * width, f"{1e3 * length:g} mm", ha="center", fontsize=7, color=EDGE, zorder=8
    )


def draw_wall(axes: Axes, wall: HalfPlane, reach: float) -> None:
    """The solid side of a half-plane, out to `reach` [m], with its surface as a line."""
    along = reach * perpendicular(wall.normal)
    foot = wall.point
    ends = np.stack([foot - along, foot + along])
    axes.fill(*np.concatenate([ends, ends[::-1] - reach * wall.normal]).T, color=WALL, lw=0, zorder=0)
    axes.plot(*ends.T, color=EDGE, lw=1, zorder=1)


def draw_arrow(axes: Axes, tail: Array, arrow: Array, color: str) -> None:
    """An arrow of constant width from `tail` along `arrow` [m]; a very short one is left out."""
    if np.linalg.norm(arrow) > 1e-6 * abs(np.diff(axes.get_xlim())[0]):
        style = {
            "arrowstyle": "-|>",
            "color": color,
            "lw": 1.5,
            "shrinkA": 0,
            "shrinkB": 0,
            "mutation_scale": 8,
        }
        axes.annotate("", xy=tuple(tail + arrow), xytext=tuple(tail), arrowprops=style, zorder=5)
