"""Fingers and grippers."""

from typing import Any

import numpy as np
import pytest

from expert.errors import InvalidProblem
from expert.world.fingers import Fingers, Gripper, require_grippers

JAWS = Gripper(fingers=(0, 3), opening=(0.0, 0.1))


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"count": 0}, "count"),
        ({"friction": 0}, "friction"),
        ({"max_force": np.inf}, "max_force"),
        ({"facet_margin": 0.51}, "facet_margin"),
        ({"clearance": -1e-9}, "clearance"),
    ],
)
def test_impossible_fingers_are_refused(changes: dict[str, Any], field: str) -> None:
    possible = {"count": 2, "friction": 0.3, "max_force": 1.0}
    Fingers(**possible)
    with pytest.raises(InvalidProblem, match=f"^fingers.{field}: "):
        Fingers(**{**possible, **changes})


@pytest.mark.parametrize(
    ("fingers", "opening"),
    [((1, 1), (0, 1)), ((-1, 0), (0, 1)), ((0, 1), (0.2, 0.1)), ((0, 1), (-0.1, 1)), ((0, 1), (0, np.nan))],
)
def test_impossible_grippers_are_refused(fingers: tuple[int, int], opening: tuple[float, float]) -> None:
    with pytest.raises(InvalidProblem, match=r"^grippers\."):
        Gripper(fingers=fingers, opening=opening)


def test_a_gripper_must_name_fingers_that_there_are() -> None:
    require_grippers([JAWS], 4)
    with pytest.raises(InvalidProblem, match=r"fingers.grippers: expected indices from 0 to 2, got \[0, 3\]"):
        require_grippers([JAWS], 3)
