"""The plane in which the object moves."""

from typing import Any

import numpy as np
import pytest

from expert.errors import InvalidProblem
from expert.world.environment import Environment


def test_the_default_is_a_sagittal_plane_on_earth_without_walls() -> None:
    here = Environment()
    assert (here.plane, here.gravity, here.walls, here.support_friction) == ("sagittal", 9.81, (), 0.3)


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"plane": "frontal"}, "environment.plane: expected sagittal or transverse, got frontal"),
        ({"gravity": 0}, "environment.gravity: expected a positive number"),
        ({"gravity": np.inf}, "environment.gravity: "),
        ({"support_friction": -0.1}, "environment.support_friction: expected a number >= 0"),
        ({"support_friction": np.nan}, "environment.support_friction: "),
    ],
)
def test_impossible_surroundings_are_refused(changes: dict[str, Any], complaint: str) -> None:
    with pytest.raises(InvalidProblem, match=f"^{complaint}"):
        Environment(**changes)
