"""Motions of an object: poses at equal time steps."""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal, get_args

import numpy as np

from expert.geometry.pose import Array
from expert.world.values import readonly, require

Ends = Literal["steady", "rest"]
"""Outside the horizon, constant velocity goes on, or the object is at rest."""


@dataclass(frozen=True, kw_only=True)
class Trajectory:
    """Object motion: poses (T, 3) of the centre of mass every dt [s], and one pose outside the horizon at each end."""

    dt: float
    poses: Array
    before: Array
    after: Array

    def __post_init__(self) -> None:
        require(0 < self.dt < np.inf, "trajectory.dt", "a positive number of seconds", self.dt)
        object.__setattr__(self, "poses", readonly(self.poses, (None, 3), "trajectory.poses"))
        require(len(self.poses) >= 2, "trajectory.poses", "at least 2 poses", len(self.poses))
        for name in ("before", "after"):
            object.__setattr__(self, name, readonly(getattr(self, name), (3,), f"trajectory.{name}"))

    @classmethod
    def of(cls, poses: object, dt: float, ends: Ends = "steady") -> "Trajectory":
        """Poses with the stated rule for what is outside the horizon."""
        q = readonly(poses, (None, 3), "trajectory.poses")
        require(len(q) >= 2, "trajectory.poses", "at least 2 poses", len(q))
        require(ends in get_args(Ends), "trajectory.ends", " or ".join(get_args(Ends)), repr(ends))
        if ends == "rest":
            return cls(dt=dt, poses=q, before=q[0], after=q[-1])
        return cls(dt=dt, poses=q, before=2 * q[0] - q[1], after=2 * q[-1] - q[-2])

    @cached_property
    def extended(self) -> Array:
        """before, poses, after: (T + 2, 3)."""
        return np.concatenate([self.before[None], self.poses, self.after[None]])

    @cached_property
    def accelerations(self) -> Array:
        """Central second differences, (T, 3) [m/s^2, rad/s^2]."""
        q = self.extended
        return (q[2:] - 2 * q[1:-1] + q[:-2]) / self.dt**2
