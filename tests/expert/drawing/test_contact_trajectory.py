"""Pictures of plans hold what they should: panels, fingers, moving frames."""

import itertools
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from expert.drawing.canvas import pixels
from expert.drawing.contact_trajectory import FRAMES_PER_STEP, draw, film_strip
from expert.drawing.marks import FINGER, FINGER_FORCE, OBJECT
from expert.errors import InvalidProblem
from expert.geometry.pose import to_world
from expert.problems.contact import FREE, ContactTask, Plan
from tests.support.hand_plans import lifted_block, pushed_block, sliding_block
from tests.support.pictures import coloured, frames_of, shown_at, texts

Made = Callable[[], tuple[ContactTask, Plan]]


@pytest.mark.parametrize("made", [sliding_block, lifted_block, pushed_block])
def test_a_film_strip_shows_object_fingers_and_forces_where_they_are_at_each_step(made: Made) -> None:
    task, plan = made()
    figure = film_strip(task, plan)
    for t, axes in enumerate(figure.axes):
        image, fingers = shown_at(figure, axes, plan.positions[t])
        touching = plan.modes[t] != FREE
        assert list(coloured(image, FINGER)[tuple(fingers.T)]) == list(touching)
        pose = task.trajectory.poses[t]
        inside = to_world(pose, 0.8 * task.body.vertices)
        image, places = shown_at(figure, axes, inside)
        assert coloured(image, OBJECT)[tuple(places.T)].mean() > 0.5  # arrows and numbers may hide some
        beyond = to_world(pose, 1.3 * task.body.vertices)
        image, places = shown_at(figure, axes, beyond)
        assert not coloured(image, OBJECT, 4)[tuple(places.T)].any()
    pushed = np.linalg.norm(plan.forces, axis=2).max() > 0
    assert coloured(image, FINGER_FORCE).sum() > 50 * pushed


def test_captions_say_what_when_how_large_and_how_strong() -> None:
    words = texts(film_strip(*sliding_block()))
    assert re.fullmatch(r"sagittal plane, 1 finger: optimal, cost [0-9.]+", words[0])
    assert [f"t = {t:.3g} s" for t in (0, 0.1, 0.2, 0.3, 0.4)] == [w for w in words if w.startswith("t =")]
    assert sum(w.endswith(" mm") for w in words) == sum(w.endswith(" N") for w in words) == 5
    assert {"object", "wall", "finger", "force of a finger", "reaction"} <= set(words)
    assert "finger without contact" not in words
    assert "0" in words


def test_vector_pictures_are_well_formed_and_repeatable(tmp_path: Path) -> None:
    for name in ("a.svg", "b.svg", "a.pdf"):
        draw(*lifted_block(), tmp_path / name)
    assert ElementTree.parse(tmp_path / "a.svg").getroot().tag.endswith("svg")
    assert (tmp_path / "a.pdf").read_bytes().startswith(b"%PDF")
    assert b"<dc:date>" not in (tmp_path / "a.svg").read_bytes()


def test_animation_moves_the_fingers_with_the_block(tmp_path: Path) -> None:
    draw(*sliding_block(), tmp_path / "slide.gif")
    frames = frames_of(tmp_path / "slide.gif")
    # equal frames at the end may be merged into one
    assert 4 * FRAMES_PER_STEP < len(frames) <= 5 * FRAMES_PER_STEP
    assert all((a != b).any() for a, b in itertools.pairwise(frames[: 4 * FRAMES_PER_STEP]))
    above_legend = slice(0, frames[0].shape[0] * 3 // 4)
    columns = [
        np.flatnonzero(coloured(frames[k][above_legend], FINGER).any(axis=0)).mean() for k in (0, 8, 16)
    ]
    steps = np.diff(columns)
    assert steps[0] > 5
    assert steps[1] == pytest.approx(steps[0], abs=2)


def test_a_task_without_a_plan_is_drawn_alone(tmp_path: Path) -> None:
    task, _ = sliding_block()
    figure = film_strip(task, Plan(status="infeasible"))
    assert texts(figure)[0] == "sagittal plane, 1 finger: infeasible"
    image = pixels(figure)
    assert not coloured(image, FINGER).any()
    assert coloured(image, OBJECT).sum() > 1000
    with pytest.raises(InvalidProblem, match="solve it first"):
        draw(task, None, tmp_path / "strip.png")


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
