"""Where the object moves: the plane with its gravity, and the walls."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from expert.world.values import require
from expert.world.walls import HalfPlane


@dataclass(frozen=True, kw_only=True)
class Environment:
    """Sagittal plane: gravity acts along -y.  Transverse plane: gravity presses the object on a support with friction."""

    plane: Literal["sagittal", "transverse"] = "sagittal"
    gravity: float = 9.81
    walls: tuple[HalfPlane, ...] = ()
    support_friction: float = 0.3

    def __post_init__(self) -> None:
        require(
            self.plane in ("sagittal", "transverse"),
            "environment.plane",
            "sagittal or transverse",
            self.plane,
        )
        require(0 < self.gravity < np.inf, "environment.gravity", "a positive number", self.gravity)
        friction = self.support_friction
        require(0 <= friction < np.inf, "environment.support_friction", "a number >= 0", friction)
