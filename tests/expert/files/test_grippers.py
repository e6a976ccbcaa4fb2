"""Grippers in files."""

from typing import Any

import pytest

from expert.errors import InvalidProblem
from expert.files.grippers import read_grippers, write_grippers
from expert.files.section import Section
from expert.world.fingers import Gripper


def read(*grippers: Any) -> tuple[Gripper, ...]:
    return read_grippers(Section({"grippers": list(grippers)}, "fingers", ("grippers",)))


def test_grippers_are_written_as_they_are_read() -> None:
    jaws = (Gripper(fingers=(0, 1), opening=(0.0, 0.2)), Gripper(fingers=(3, 2), opening=(0.1, 0.1)))
    assert read(*write_grippers(jaws)) == jaws
    assert read() == read_grippers(Section({}, "fingers", ("grippers",))) == ()


@pytest.mark.parametrize(
    ("gripper", "complaint"),
    [
        ({"fingers": [0, 0.5], "opening": [0, 1]}, r"fingers.grippers\[0\].fingers: expected two indices"),
        ({"fingers": [0], "opening": [0, 1]}, r"fingers.grippers\[0\].fingers: expected a list of 2"),
        ({"fingers": [0, 0], "opening": [0, 1]}, "grippers.fingers: expected two different"),
        ({"fingers": [0, 1], "opening": [1, 0]}, "grippers.opening: expected 0 <= least <= most"),
        ({"fingers": [0, 1]}, r"fingers.grippers\[0\].opening: .* nothing"),
        ({"fingers": [0, 1], "opening": [0, 1], "width": 1}, r"fingers.grippers\[0\].width: .* unknown key"),
    ],
)
def test_what_is_no_gripper_is_refused(gripper: Any, complaint: str) -> None:
    with pytest.raises(InvalidProblem, match=f"^{complaint}"):
        read(gripper)
