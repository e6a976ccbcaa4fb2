"""Point fingers and what holds them."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from expert.world.values import require


@dataclass(frozen=True, kw_only=True)
class Fingers:
    """Point fingers: count C, friction coefficient, largest normal force [N], fraction kept from facet ends, clearance [m].

    clearance is kept from walls; what free fingers keep from the object is Robustness.free_clearance.
    """

    count: int
    friction: float
    max_force: float
    facet_margin: float = 0.05
    clearance: float = 0.002

    def __post_init__(self) -> None:
        require(self.count >= 1, "fingers.count", "at least 1", self.count)
        require(0 < self.friction < np.inf, "fingers.friction", "a positive number", self.friction)
        require(
            0 < self.max_force < np.inf, "fingers.max_force", "a positive number of newtons", self.max_force
        )
        require(
            0 <= self.facet_margin <= 0.5,
            "fingers.facet_margin",
            "a fraction from 0 to 0.5",
            self.facet_margin,
        )
        require(0 <= self.clearance < np.inf, "fingers.clearance", "a length >= 0 in metres", self.clearance)


@dataclass(frozen=True, kw_only=True)
class Gripper:
    """Parallel jaws: two of the searched fingers, by index, whose distance stays within opening = (least, most) [m]."""

    fingers: tuple[int, int]
    opening: tuple[float, float]

    def __post_init__(self) -> None:
        i, j = self.fingers
        require(i != j and min(i, j) >= 0, "grippers.fingers", "two different indices", list(self.fingers))
        least, most = self.opening
        require(0 <= least <= most < np.inf, "grippers.opening", "0 <= least <= most", [least, most])


def require_grippers(grippers: Iterable[Gripper], count: int) -> None:
    """Raise InvalidProblem for a gripper that names a finger beyond the first `count`."""
    for gripper in grippers:
        known = max(gripper.fingers) < count
        require(known, "fingers.grippers", f"indices from 0 to {count - 1}", list(gripper.fingers))
