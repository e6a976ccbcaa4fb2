"""Walls: half-planes, and segments that bound the object from both sides."""

from dataclasses import dataclass

import numpy as np

from expert.geometry.pose import Array
from expert.world.values import readonly, require


@dataclass(frozen=True, kw_only=True)
class HalfPlane:
    """Wall: the free side is {x : normal . (x - point) >= 0}.  point [m], unit normal, world frame, shape (2,)."""

    point: Array
    normal: Array
    friction: float = 0.0
    name: str = "wall"

    def __post_init__(self) -> None:
        for key in ("point", "normal"):
            object.__setattr__(self, key, readonly(getattr(self, key), (2,), f"{self.name}.{key}"))
        length = float(np.linalg.norm(self.normal))
        require(
            abs(length - 1) < 1e-6,
            f"{self.name}.normal",
            "a unit vector",
            f"length {length:.3g}",
            "divide it by its length",
        )
        require(0 <= self.friction < np.inf, f"{self.name}.friction", "a number >= 0", self.friction)

    def gap(self, points: Array) -> Array:
        """Signed distance of points (..., 2) from the wall [m], negative inside."""
        return (np.asarray(points) - self.point) @ self.normal


def wall_segments(walls: object) -> Array:
    """Checked segments (W, 2 ends, 2) [m].  Raises InvalidProblem."""
    listed = np.empty((0, 2, 2)) if walls is None or np.size(walls) == 0 else walls  # type: ignore[arg-type]
    segments = readonly(listed, (None, 2, 2), "walls")
    for k, (a, b) in enumerate(segments):
        require(bool((a != b).any()), f"walls[{k}]", "two different ends", "a point")
    return segments
