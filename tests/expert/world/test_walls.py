"""Walls: signed distances, and what is no wall."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from expert.errors import InvalidProblem
from expert.world.walls import HalfPlane, Obstacle, Segment, segment_ends, segments

SQUARE = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
ANGLES, COORDINATES = st.floats(-4, 4), st.floats(-3, 3)


@given(ANGLES, COORDINATES, COORDINATES, COORDINATES, COORDINATES)
def test_the_gap_of_a_half_plane_is_the_distance_along_its_normal(
    angle: float, x: float, y: float, along: float, away: float
) -> None:
    normal = np.array([np.cos(angle), np.sin(angle)])
    wall = HalfPlane(point=np.array([x, y]), normal=normal)
    place = wall.point + away * normal + along * np.array([-normal[1], normal[0]])
    assert wall.gap(place) == pytest.approx(away, abs=1e-12)


def test_a_polygon_is_solid_inside_whichever_way_it_is_listed() -> None:
    for vertices in (SQUARE, SQUARE[::-1]):
        block = Obstacle(vertices=vertices, friction=0.2)
        gaps = block.gap(np.array([[0.5, 0.9], [0.5, 1.25], [2, 2], [0.5, 0.5]]))
        np.testing.assert_allclose(gaps, [-0.1, 0.25, np.sqrt(2), -0.5])
        assert not block.vertices.flags.writeable


def test_segments_are_named_by_their_place_and_give_their_ends_back() -> None:
    ends = np.array([[[0, 0], [1, 0]], [[0, 1], [1, 2]]])
    walls = segments(ends)
    assert [wall.name for wall in walls] == ["walls[0]", "walls[1]"]
    np.testing.assert_array_equal(segment_ends(walls), ends)
    assert segment_ends(()).shape == (0, 2, 2)


@pytest.mark.parametrize(
    ("noun", "fields", "complaint"),
    [
        (HalfPlane, {"point": [0, 0], "normal": [0, 2]}, "wall.normal: expected a unit vector, got length 2"),
        (HalfPlane, {"point": [0], "normal": [0, 1]}, "wall.point: "),
        (HalfPlane, {"point": [0, 0], "normal": [0, 1], "friction": np.nan}, "wall.friction: "),
        (Segment, {"ends": [[1, 1], [1, 1]]}, "wall: expected two different ends, got a point"),
        (Segment, {"ends": [[0, 0], [1, 1]], "friction": -1}, "wall.friction: "),
        (Obstacle, {"vertices": SQUARE[[0, 2, 1, 3]]}, "wall.vertices: expected a simple polygon"),
        (Obstacle, {"vertices": SQUARE, "friction": np.inf}, "wall.friction: "),
    ],
)
def test_what_is_no_wall_is_refused(noun: Any, fields: dict[str, Any], complaint: str) -> None:
    with pytest.raises(InvalidProblem, match=f"^{complaint}"):
        noun(**fields)
