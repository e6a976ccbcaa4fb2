"""Pictures of plans hold what they should: panels, fingers, moving frames."""

import shutil
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image

from expert.drawing.contact_trajectory import FRAMES_PER_STEP, draw
from expert.errors import InvalidProblem
from expert.problems.contact import ContactTask, Plan
from tests.support.hand_plans import lifted_block, pushed_block, sliding_block

Made = Callable[[], tuple[ContactTask, Plan]]


def reddish(image: np.ndarray) -> np.ndarray:
    """Pixels in the colour of the fingers."""
    red, green, blue = (image[..., i].astype(int) for i in range(3))
    return (red > 150) & (green < 80) & (blue < 100)


def pixels_of(path: Path, frame: int = 0) -> np.ndarray:
    with Image.open(path) as image:
        image.seek(frame)
        return np.asarray(image.convert("RGB"))


@pytest.mark.parametrize("made", [sliding_block, lifted_block, pushed_block])
def test_film_strip_shows_a_finger_in_each_panel(made: Made, tmp_path: Path) -> None:
    draw(*made(), tmp_path / "strip.png")
    panels = np.array_split(reddish(pixels_of(tmp_path / "strip.png")), 5, axis=1)
    assert all(panel.sum() > 15 for panel in panels)


def test_vector_pictures_are_well_formed_and_repeatable(tmp_path: Path) -> None:
    for name in ("a.svg", "b.svg", "a.pdf"):
        draw(*lifted_block(), tmp_path / name)
    assert ElementTree.parse(tmp_path / "a.svg").getroot().tag.endswith("svg")
    assert (tmp_path / "a.pdf").read_bytes().startswith(b"%PDF")
    assert b"<dc:date>" not in (tmp_path / "a.svg").read_bytes()


def test_animation_moves_the_fingers_with_the_block(tmp_path: Path) -> None:
    draw(*sliding_block(), tmp_path / "slide.gif")
    with Image.open(tmp_path / "slide.gif") as image:
        count: int = image.n_frames  # type: ignore[attr-defined]
    assert (
        4 * FRAMES_PER_STEP < count <= 5 * FRAMES_PER_STEP
    )  # equal frames at the end may be merged into one
    columns = [
        np.flatnonzero(reddish(pixels_of(tmp_path / "slide.gif", k)).any(axis=0)).mean() for k in (0, 8, 16)
    ]
    steps = np.diff(columns)
    assert steps[0] > 5
    assert steps[1] == pytest.approx(steps[0], abs=2)


def test_a_task_without_a_plan_is_drawn_alone(tmp_path: Path) -> None:
    task, _ = sliding_block()
    draw(task, Plan(status="infeasible"), tmp_path / "strip.png")
    image = pixels_of(tmp_path / "strip.png")
    assert not reddish(image).any()
    assert (image.min(axis=2) < 100).any()


def test_videos_are_written_where_an_encoder_exists(tmp_path: Path) -> None:
    cv2 = pytest.importorskip("cv2")
    draw(*sliding_block(), tmp_path / "slide.mp4")
    capture = cv2.VideoCapture(str(tmp_path / "slide.mp4"))
    frames = 0
    while capture.read()[0]:
        frames += 1
    assert frames == 5 * FRAMES_PER_STEP


def test_videos_without_an_encoder_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "which", lambda _: None)
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    with pytest.raises(InvalidProblem, match="ffmpeg or OpenCV"):
        draw(*sliding_block(), tmp_path / "slide.mp4")


def test_other_suffixes_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidProblem, match="bmp"):
        draw(*sliding_block(), tmp_path / "slide.bmp")
