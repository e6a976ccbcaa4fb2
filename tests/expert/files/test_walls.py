"""Walls in files: three forms told apart by their keys, each kind of problem accepts some, and all are written as they are read."""

from typing import Any

import numpy as np
import pytest

from expert.errors import InvalidProblem
from expert.files.section import Section
from expert.files.walls import read_walls, write_walls
from expert.world.walls import HalfPlane, Obstacle, Segment
from tests.support.same import assert_same

ALL = (HalfPlane, Segment, Obstacle)
FLOOR = {"point": [0, 1], "normal": [0, 2], "friction": 0.3}
FENCE = {"from": [0, 0], "to": [1, 2], "friction": 0.1}
BLOCK = {"vertices": [[0, 0], [0, 1], [1, 1], [1, 0]]}


def read(*walls: Any, accepted: tuple[type, ...] = ALL) -> tuple[Any, ...]:
    return read_walls(Section({"walls": list(walls)}, "", ("walls",)), "walls", accepted)


def test_each_form_becomes_its_noun() -> None:
    floor, fence, block = read(FLOOR, FENCE, BLOCK)
    assert_same(floor, HalfPlane(point=np.array([0.0, 1]), normal=np.array([0.0, 1]), friction=0.3))
    assert_same(fence, Segment(ends=np.array([[0.0, 0], [1, 2]]), friction=0.1))
    counter_clockwise = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    assert_same(block, Obstacle(vertices=counter_clockwise))
    assert_same(read(*write_walls((floor, fence, block))), (floor, fence, block))


def test_no_list_means_no_walls() -> None:
    assert read_walls(Section({}, "", ("walls",)), "walls", ALL) == ()


@pytest.mark.parametrize(
    ("wall", "accepted", "complaint"),
    [
        (FENCE, (HalfPlane,), r"walls\[0\]: expected a half-plane {point, normal}, got a segment {from, to}; .* no other walls yet"),
        (BLOCK, (HalfPlane, Segment), r"walls\[0\]: expected a half-plane .* or a segment .*, got a polygon {vertices}"),
        ({**FLOOR, **FENCE}, ALL, r"walls\[0\]: expected .*, got a half-plane and a segment"),
        ({"friction": 0.1}, ALL, r"walls\[0\]: expected .*, got none of these keys"),
        ({"point": [0, 0]}, ALL, r"walls\[0\].normal: .* nothing"),
        ({"from": [0, 0]}, ALL, r"walls\[0\].to: .* nothing"),
        ({**FLOOR, "nromal": [0, 1]}, ALL, r"walls\[0\].nromal: .* did you mean normal"),
        ({**FLOOR, "normal": [0, 0]}, ALL, r"walls\[0\].normal: .* zero vector"),
        ({**FENCE, "friction": -1}, ALL, r"walls\[0\].friction: expected a number >= 0, got -1"),
        ({"vertices": [[0, 0], [1, 1], [1, 0], [0, 1]]}, ALL, r"walls\[0\].vertices: .* cross"),
        ({"vertices": [[0, 0], [1, 1]]}, ALL, r"walls\[0\].vertices: "),
    ],
)  # fmt: skip
def test_what_is_no_such_wall_is_refused_in_one_line(
    wall: Any, accepted: tuple[type, ...], complaint: str
) -> None:
    with pytest.raises(InvalidProblem, match=f"^{complaint}") as caught:
        read(wall, accepted=accepted)
    assert "\n" not in str(caught.value)
