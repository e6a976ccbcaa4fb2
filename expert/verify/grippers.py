"""Can parallel jaws hold fingers where an answer puts them?  Written from the definitions, without the rows of any model."""

import itertools
from collections.abc import Sequence

import numpy as np

from expert.geometry.pose import Array, cross
from expert.world.fingers import Gripper

TOLERANCE = 1e-5
"""Of lengths, relative to the object's size; of areas, to its square."""


def opening_fault(grippers: Sequence[Gripper], fingers: Array, size: float) -> str:
    """Which gripper is not open as it can be with its fingers at (N, 2) [m]; empty: none."""
    for k, gripper in enumerate(grippers):
        i, j = gripper.fingers
        length = float(np.linalg.norm(fingers[j] - fingers[i]))
        least, most = gripper.opening
        if not least - TOLERANCE * size <= length <= most + TOLERANCE * size:
            return f"gripper {k} opens by {length:.4g} m, outside [{least:g}, {most:g}]"
    return ""


def direction_fault(
    grippers: Sequence[Gripper], fingers: Array, size: float, direction: float | None = None
) -> str:
    """Which gripper does not open, from its first to its second finger, along one common direction; empty: none.

    direction: that direction [rad], world, where it is stated.
    """
    area = TOLERANCE * size**2
    steps = [(f"gripper {k}", fingers[g.fingers[1]] - fingers[g.fingers[0]]) for k, g in enumerate(grippers)]
    if direction is not None:
        steps.append(("the stated direction", size * np.array([np.cos(direction), np.sin(direction)])))
    for (one, a), (other, b) in itertools.combinations(steps, 2):
        if abs(cross(a, b)) > area or a @ b < -area:
            return f"{one} is not parallel to {other}"
    return ""
