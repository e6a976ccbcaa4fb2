"""What parallel jaws can hold: openings and common directions."""

import numpy as np
import pytest

from expert.verify.grippers import direction_fault, opening_fault
from expert.world.fingers import Gripper

FINGERS = np.array([[0.0, 0.0], [0.3, 0.4], [1.0, 0.0], [1.6, 0.8]])
"""Two pairs, 0.5 and 1 apart, both along (3, 4)."""
PAIRS = (Gripper(fingers=(0, 1), opening=(0.4, 0.6)), Gripper(fingers=(2, 3), opening=(0.0, 1.0)))


def test_openings_within_their_limits_are_accepted() -> None:
    assert opening_fault(PAIRS, FINGERS, size=1.0) == ""


@pytest.mark.parametrize("opening", [(0.0, 0.49), (0.51, 2.0)])
def test_openings_beyond_their_limits_are_named(opening: tuple[float, float]) -> None:
    assert "gripper 0 opens by 0.5 m" in opening_fault(
        [Gripper(fingers=(0, 1), opening=opening)], FINGERS, 1.0
    )


def test_one_direction_for_all_or_the_stated_one() -> None:
    along = float(np.arctan2(4, 3))
    assert direction_fault(PAIRS, FINGERS, 1.0) == ""
    assert direction_fault(PAIRS, FINGERS, 1.0, along) == ""
    assert "gripper 0" in direction_fault(PAIRS, FINGERS, 1.0, along + 0.001)
    assert "gripper 0" in direction_fault(PAIRS, FINGERS, 1.0, along + np.pi)  # it opens the other way
    turned = (PAIRS[0], Gripper(fingers=(3, 2), opening=(0.0, 1.0)))
    assert direction_fault(turned, FINGERS, 1.0) == "gripper 0 is not parallel to gripper 1"
