"""Grippers in files: a list of {fingers: [i, j], opening: [least, most]} [m]."""

from collections.abc import Iterable
from typing import Any

from expert.errors import InvalidProblem
from expert.files.section import Section
from expert.world.fingers import Gripper


def read_grippers(fingers: Section) -> tuple[Gripper, ...]:
    """The grippers of a section of fingers; none where they are missing.  Raises InvalidProblem."""
    grippers = []
    for gripper in fingers.sections("grippers", ("fingers", "opening")):
        i, j = gripper.array("fingers", (2,))
        if i != int(i) or j != int(j):
            raise InvalidProblem(gripper.path("fingers"), expected="two indices", got=f"[{i:g}, {j:g}]")
        least, most = gripper.array("opening", (2,))
        grippers.append(Gripper(fingers=(int(i), int(j)), opening=(float(least), float(most))))
    return tuple(grippers)


def write_grippers(grippers: Iterable[Gripper]) -> list[dict[str, Any]]:
    """The list that `read_grippers` reads."""
    return [{"fingers": list(gripper.fingers), "opening": list(gripper.opening)} for gripper in grippers]
