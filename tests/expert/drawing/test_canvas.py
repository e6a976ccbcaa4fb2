"""Figures and frames reach their files as they are: exact colours, all frames, the kind that the name asks for."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from expert.drawing.canvas import (
    Image8,
    framed_axes,
    new_figure,
    pixels,
    room_below,
    save_figure,
    save_frames,
    square_axes,
    suffix,
)
from expert.errors import InvalidProblem
from tests.support.pictures import frames_of

RED, GREEN = (200, 16, 46), (26, 138, 60)


def blocks(k: int) -> Image8:
    """White with a red block that moves, and green next to it."""
    image = np.full((40, 61, 3), 255, dtype=np.uint8)
    image[5:15, 3 * k : 3 * k + 10] = RED
    image[20:30, 5:15] = GREEN
    return image


def test_the_name_decides_the_kind_of_file() -> None:
    assert [suffix(name) for name in ("a.PNG", "b.gif")] == [".png", ".gif"]
    for name in ("a.bmp", "a", "png"):
        with pytest.raises(InvalidProblem, match=r"^output: expected a name that ends in \.png, "):
            suffix(name)


def test_a_picture_keeps_the_colours_of_its_areas(tmp_path: Path) -> None:
    figure = new_figure(2, 1)
    axes = figure.add_subplot()
    axes.set_axis_off()
    axes.imshow([[[200, 16, 46], [26, 138, 60]]], aspect="auto", interpolation="nearest")
    save_figure(figure, tmp_path / "a.png")
    (image,) = frames_of(tmp_path / "a.png")
    assert image.shape == (100, 200, 3)
    assert tuple(image[50, 50]) == RED
    assert tuple(image[50, 150]) == GREEN
    np.testing.assert_array_equal(image, pixels(figure))


def test_an_animation_keeps_its_frames_colours_and_rate(tmp_path: Path) -> None:
    save_frames([blocks(k) for k in range(6)], tmp_path / "a.gif", rate=10)
    frames = frames_of(tmp_path / "a.gif")
    assert len(frames) == 6
    for k, frame in enumerate(frames):
        np.testing.assert_array_equal(frame, blocks(k))
    with Image.open(tmp_path / "a.gif") as image:
        assert image.info["duration"] == 100


@pytest.mark.skipif(importlib.util.find_spec("cv2") is None, reason="needs an encoder")
def test_a_video_has_all_frames_and_even_sizes(tmp_path: Path) -> None:
    cv2 = pytest.importorskip("cv2")
    save_frames([blocks(k) for k in range(6)], tmp_path / "a.mp4", rate=10)
    capture = cv2.VideoCapture(str(tmp_path / "a.mp4"))
    read = [capture.read()[1] for _ in range(6)]
    assert [frame.shape for frame in read] == [(40, 60, 3)] * 6
    assert not capture.read()[0]
    assert np.abs(read[3][10, 14, ::-1].astype(int) - RED).max() < 60


def test_views_are_square_framed_or_have_room_below() -> None:
    axes = new_figure(2, 2).add_subplot()
    framed_axes(axes, np.array([[0.0, 0], [2, 1]]), 0.1)
    assert (axes.get_xlim(), axes.get_ylim()) == ((-0.2, 2.2), (-0.2, 1.2))
    square_axes(axes)
    np.testing.assert_allclose([axes.get_xlim(), axes.get_ylim()], [(-0.2, 2.2), (-0.7, 1.7)])
    low, high = room_below(np.zeros(2), np.array([2.0, 1.0]))
    assert low[1] < -0.2
    np.testing.assert_array_equal([low[0], *high], [0, 2, 1])
