"""Answer to a search for a cage."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from expert.geometry.pose import Array

CageStatus = Literal["caged", "none_found", "time_limit"]


@dataclass(frozen=True, kw_only=True)
class Meeting:
    """Obstacle piece `piece` of element `element` overlaps `next_piece` of the next element of the loop.

    Elements are the searched fingers, then the fixed ones, then the walls; pieces index the object's convex cover.
    """

    element: int
    piece: int
    next_element: int
    next_piece: int


@dataclass(frozen=True, kw_only=True)
class CageSolution:
    """Fingers that cage an object, confirmed by `expert.verify.cage`, or why there are none.

    status: caged (verified), none_found (no cage of the kind that was searched for, at the half-ranges tried: not a
    proof that none exists), time_limit (nothing verified in time).
    fingers (count, 2) [m], without the fixed ones.  rotation_range: verified orientations [rad].
    objective: cost [m or m^2], nan without cost.  seconds: processor time.  attempts: models solved and grasps tried.  refuted, unconfirmed: answers of the model
    that the verifier refuted or could not decide; they were cut off.
    """

    status: CageStatus
    fingers: Array = field(default_factory=lambda: np.empty((0, 2)))
    rotation_range: tuple[float, float] | None = None
    topology: tuple[Meeting, ...] = ()
    objective: float = np.nan
    seconds: float = 0.0
    attempts: int = 0
    refuted: int = 0
    unconfirmed: int = 0
    reason: str = ""

    @property
    def found(self) -> bool:
        """Whether there is a verified cage."""
        return self.status == "caged"
