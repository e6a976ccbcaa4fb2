"""Walls: half-planes and polygons, which are solid, and segments, which bound the object from both sides."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from expert.geometry.polygon import signed_distance, simple_polygon
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
        _require_friction(self)

    def gap(self, points: Array) -> Array:
        """Signed distance of points (..., 2) from the wall [m], negative inside."""
        return (np.asarray(points) - self.point) @ self.normal


@dataclass(frozen=True, kw_only=True)
class Segment:
    """Wall without thickness between two ends (2, 2) [m], world frame."""

    ends: Array
    friction: float = 0.0
    name: str = "wall"

    def __post_init__(self) -> None:
        object.__setattr__(self, "ends", readonly(self.ends, (2, 2), self.name))
        apart = bool((self.ends[0] != self.ends[1]).any())
        require(apart, self.name, "two different ends", "a point")
        _require_friction(self)


@dataclass(frozen=True, kw_only=True)
class Obstacle:
    """Wall: a simple polygon (V, 2) [m], counter-clockwise, world frame, solid inside."""

    vertices: Array
    friction: float = 0.0
    name: str = "wall"

    def __post_init__(self) -> None:
        vertices = simple_polygon(self.vertices, field=f"{self.name}.vertices")
        vertices.setflags(write=False)
        object.__setattr__(self, "vertices", vertices)
        _require_friction(self)

    def gap(self, points: Array) -> Array:
        """Signed distance of points (..., 2) from the outline [m], negative inside."""
        return signed_distance(self.vertices, np.asarray(points, dtype=float))


Wall = HalfPlane | Segment | Obstacle


def _require_friction(wall: Wall) -> None:
    require(0 <= wall.friction < np.inf, f"{wall.name}.friction", "a number >= 0", wall.friction)


def segments(ends: ArrayLike) -> tuple[Segment, ...]:
    """Segments with the given ends (W, 2, 2) [m].  Raises InvalidProblem."""
    listed = readonly(np.reshape(ends, (-1, 2, 2)), (None, 2, 2), "walls")
    return tuple(Segment(ends=pair, name=f"walls[{k}]") for k, pair in enumerate(listed))


def segment_ends(walls: Iterable[Segment]) -> Array:
    """Ends (W, 2, 2) [m] of segments."""
    return np.array([wall.ends for wall in walls], dtype=float).reshape(-1, 2, 2)
