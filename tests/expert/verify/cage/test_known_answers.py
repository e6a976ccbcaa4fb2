"""Answers known from elsewhere: what passes a door, and what unwinds."""

import numpy as np
import pytest

from expert.problems.cage import Arrangement
from expert.verify.cage.check import verify_cage
from expert.world.shape import Shape
from expert.world.walls import segments
from tests.support.polygons import spiral

FAR = [[30.0, 30.0], [30.0, -30.0]]
"""Two fingers that take no part."""


def room(corners: int, excess: float) -> Arrangement:
    """A regular polygon in a room whose door is by a share `excess` wider than the polygon's width."""
    turns = 2 * np.pi * np.arange(corners) / corners
    door = np.cos(np.pi / corners) * (1 + excess)  # half of it; the width is twice the inradius
    walls = [
        ([-1.5, -1.5], [1.5, -1.5]), ([-1.5, 1.5], [1.5, 1.5]), ([-1.5, -1.5], [-1.5, 1.5]),
        ([1.5, -1.5], [1.5, -door]), ([1.5, door], [1.5, 1.5]),
    ]  # fmt: skip
    return Arrangement(
        shape=Shape(vertices=np.column_stack([np.cos(turns), np.sin(turns)])),
        pose=np.zeros(3),
        fingers=np.array(FAR),
        walls=segments(walls),
    )


def test_a_convex_polygon_passes_a_door_a_little_wider_than_itself() -> None:
    """The width of a chair (Strang 1982): a convex object passes where the door is as wide as its least width."""
    assert verify_cage(room(200, 1e-4)).verdict == "escapes"


@pytest.mark.slow
def test_it_does_not_pass_a_door_a_little_narrower() -> None:
    assert verify_cage(room(200, -1e-4)).verdict == "caged"


@pytest.mark.parametrize("turns", [1.5, 2.5, 5.5])
def test_a_spiral_unwinds_from_a_finger(turns: float) -> None:
    """The finger is half a turn from the groove's inner end: the object turns about as often as the groove does."""
    share = 0.4
    radius = 0.1 + 0.4 / turns * (0.5 + share + (1 - share) / 2)
    finger = radius * np.array([np.cos(np.pi), np.sin(np.pi)])
    scene = Arrangement(
        shape=Shape(vertices=spiral(turns, share=share, corners=12)),
        pose=np.zeros(3),
        fingers=np.array([finger, [3.0, 3.0]]),
    )
    report = verify_cage(scene)
    assert report.verdict == "escapes"
    assert len(report.path) > 8 * (turns - 1.5)
