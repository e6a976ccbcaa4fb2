"""Marks stand where things are, in their colours, with numbers and scales that say true lengths."""

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from expert.drawing.canvas import new_figure, plain_axes
from expert.drawing.marks import (
    EDGE,
    ENTRIES,
    FINGER,
    FINGER_FORCE,
    FINGERS,
    OBJECT,
    WALL,
    closed,
    draw_arrow,
    draw_fingers,
    draw_half_plane,
    draw_object,
    draw_segment,
    finger_colour,
    force_scale,
    legend,
    round_down,
    scale_bar,
)
from expert.geometry.pose import Array
from expert.world.walls import HalfPlane
from tests.support.pictures import coloured, shown_at, texts

SQUARE = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], dtype=float)


def panel(low: float = -3, high: float = 3) -> tuple[Figure, Axes]:
    figure = new_figure(3, 3)
    axes = figure.add_subplot()
    plain_axes(axes, np.full(2, low), np.full(2, high))
    return figure, axes


def colour_at(figure: Figure, axes: Axes, points: list[list[float]], colour: str) -> list[bool]:
    image, places = shown_at(figure, axes, np.array(points, dtype=float))
    return [bool(coloured(image, colour)[row, column]) for row, column in places]


def test_the_object_is_where_its_corners_are() -> None:
    figure, axes = panel()
    draw_object(axes, SQUARE, [SQUARE])
    assert colour_at(figure, axes, [[0, 0], [-0.9, 0.9], [1.2, 0], [0, -1.2]], OBJECT) == [
        True,
        True,
        False,
        False,
    ]
    assert colour_at(figure, axes, [[1, 0.5], [0.3, -1]], EDGE) == [True, True]
    np.testing.assert_array_equal(closed(SQUARE)[[0, -1]], SQUARE[[0, 0]])


def test_fingers_are_filled_or_hollow_and_numbered() -> None:
    figure, axes = panel()
    draw_fingers(axes, np.array([[-2, 0], [2, 0]]), around=np.zeros(2), hollow=[False, True], first=3)
    assert colour_at(figure, axes, [[-2, 0], [2, 0]], FINGER) == [True, False]
    assert texts(figure) == ["3", "4"]
    figure, axes = panel()
    places = [[float(k) - 2, 0.0] for k in range(4)]
    draw_fingers(axes, np.array(places), around=np.array([0, -2]), colours=FINGERS)
    for k, place in enumerate(places):
        assert colour_at(figure, axes, [place], finger_colour(k)) == [True]


def test_a_finger_on_the_object_s_middle_has_its_number_beside_it() -> None:
    figure, axes = panel()
    draw_fingers(axes, np.zeros((1, 2)), around=np.zeros(2))
    assert texts(figure) == ["0"]


def test_half_planes_are_solid_behind_their_surface() -> None:
    figure, axes = panel()
    draw_half_plane(axes, HalfPlane(point=np.array([1.0, 0]), normal=np.array([-1.0, 0])))
    assert colour_at(figure, axes, [[2, 2], [2.5, -2.5], [0, 0]], WALL) == [True, True, False]


@pytest.mark.parametrize("ends", [[[-2, -2], [2, -2]], [[2, -2], [-2, -2]]])
def test_segments_have_their_band_away_from_the_object(ends: Array) -> None:
    figure, axes = panel()
    draw_segment(axes, np.array(ends, dtype=float), SQUARE)
    image, places = shown_at(figure, axes, np.array([[0, -2.05], [0, -1.9]]))
    beyond, before = image[tuple(places[0])], image[tuple(places[1])]
    assert (before == 255).all()
    assert (beyond < 250).all()


def test_arrows_go_from_tail_to_head_and_short_ones_are_left_out() -> None:
    figure, axes = panel()
    draw_arrow(axes, np.array([-2.0, 0]), np.array([3.0, 0]), FINGER_FORCE)
    draw_arrow(axes, np.array([0.0, 2]), np.array([1e-9, 0]), FINGER_FORCE)
    assert colour_at(figure, axes, [[-1, 0], [0.5, 0], [1.5, 0], [0, 2]], FINGER_FORCE) == [
        True,
        True,
        False,
        False,
    ]


@given(st.floats(1e-6, 1e6))
def test_round_numbers_are_one_two_or_five_and_not_far_below(value: float) -> None:
    below = round_down(value)
    assert value / 2.5 * (1 - 1e-9) <= below <= value * (1 + 1e-9)
    assert re.fullmatch("[125]", f"{below:.15e}"[0])
    assert float(f"{below:.0e}") == pytest.approx(below)


@pytest.mark.parametrize("width", [0.03, 0.2, 7.0])
def test_the_bar_is_as_long_as_it_says(width: float) -> None:
    figure, axes = panel(0, width)
    scale_bar(axes)
    (bar,) = axes.lines
    (words,) = texts(figure)
    millimetres = float(words.removesuffix(" mm"))
    assert np.ptp(bar.get_xdata()) == pytest.approx(1e-3 * millimetres)
    assert 0.1 < np.ptp(bar.get_xdata()) / width < 0.3


@pytest.mark.parametrize("metres_per_newton", [0.01, 0.3, 20.0])
def test_the_arrow_of_forces_is_as_long_as_such_a_force(metres_per_newton: float) -> None:
    _, axes = panel(0, 1)
    force_scale(axes, metres_per_newton)
    arrow, words = axes.texts
    length = float(np.linalg.norm(np.subtract(arrow.xy, arrow.xyann)))  # type: ignore[attr-defined]
    assert length == pytest.approx(float(words.get_text().removesuffix(" N")) * metres_per_newton)
    assert 0.1 < length < 0.31


def test_a_legend_names_what_it_is_asked_for_and_nothing_else() -> None:
    figure, _ = panel()
    legend(figure, "object", "finger, one colour each")
    assert texts(figure) == ["object", "finger, one colour each"]
    for name, sample in ENTRIES.items():
        assert sample() is not None, name
    with pytest.raises(KeyError):
        legend(figure, "unicorn")
