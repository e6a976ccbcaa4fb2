"""What the checker of cages answers."""

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from expert.geometry.pose import Array
from expert.verify.report import Report


@dataclass(frozen=True, kw_only=True)
class CageReport(Report):
    """What was shown.

    rotation_range: orientations [rad] that the object can reach at most (caged); (-inf, inf) where it may turn for good.
    path: body poses (K, 3) of an escape; neighbours differ by a translation or by a rotation about a fixed point.
    turns_beyond: whether it is shown to reach orientations that it was expected not to.
    resolution: half-width [rad] of the smallest cell.  cells: how many were computed.
    An answer is refuted before its cage is looked at where its grippers cannot do it, or its cost is another.
    """

    certificate = "cage"

    verdict: Literal["caged", "escapes", "unknown", "refuted"]
    cells: int = 0
    resolution: float = np.pi
    rotation_range: tuple[float, float] | None = None
    turns_beyond: bool = False
    path: Array = field(default_factory=lambda: np.empty((0, 3)))

    def evidence(self) -> dict[str, Any]:
        """Orientations or path; an unlimited rotation_range is null."""
        limited = self.rotation_range is not None and np.isfinite(self.rotation_range).all()
        return {
            "rotation_range": list(self.rotation_range) if self.rotation_range and limited else None,
            "turns_freely": self.rotation_range is not None and not limited,
            "cells": self.cells,
            "resolution": self.resolution,
            "path": self.path.tolist(),
        }

    def lines(self) -> list[str]:
        """One line."""
        cells = f"{self.cells} cells, half-width down to {np.degrees(self.resolution):.3g} deg"
        return [f"{self.verdict}: {self.reason or self._summary()}" + (f" ({cells})" if self.cells else "")]

    def _summary(self) -> str:
        if self.verdict == "escapes":
            return f"a collision-free path of {len(self.path)} poses, checked exactly"
        if self.verdict == "unknown":
            return "inner and outer approximations still disagree"
        low, high = np.degrees(self.rotation_range or (-np.inf, np.inf))
        return f"orientations within [{low:.4g}, {high:.4g}] deg" if np.isfinite(low) else "any orientation"
