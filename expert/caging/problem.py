"""The nouns of caging: an object among obstacles (`Arrangement`) and the search for fingers (`CageProblem`).

The object is a polygon in its body frame [m]; `pieces` are convex polygons whose union it is.  Fingers are points and
walls are segments, world frame [m].  The object's open interior must not meet them: touching is allowed.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np
import shapely

from expert.errors import InvalidProblem
from expert.geometry.convex import convex_pieces
from expert.geometry.polygon import diameter, is_convex, signed_distance, simple_polygon
from expert.geometry.pose import Array, to_body
from expert.types import readonly, require

START_TOLERANCE = 1e-7
"""A finger or wall may enter the object at the start pose by this fraction of its diameter."""
COVER_TOLERANCE = 1e-9
"""Given pieces may miss or exceed the object's area by this fraction."""


@dataclass(frozen=True, kw_only=True)
class Shape:
    """Polygon (V, 2) [m, body frame], counter-clockwise, and convex pieces ((v, 2), ...) that cover exactly it.

    Raises InvalidProblem for pieces that are not convex, reach outside, or leave parts uncovered.
    """

    vertices: Array
    pieces: tuple[Array, ...] = ()

    def __post_init__(self) -> None:
        vertices = simple_polygon(self.vertices, field="object.vertices")
        pieces = tuple(_convex_piece(p, k) for k, p in enumerate(self.pieces or convex_pieces(vertices)))
        _require_cover(shapely.Polygon(vertices), pieces)
        for array in (vertices, *pieces):
            array.setflags(write=False)
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "pieces", pieces)

    @classmethod
    def of_pieces(cls, pieces: Sequence[object]) -> "Shape":
        """The union of convex pieces.  Raises InvalidProblem where it has a hole or falls apart."""
        require(len(pieces) > 0, "object.pieces", "at least one convex polygon", "none")
        checked = [_convex_piece(p, k) for k, p in enumerate(pieces)]
        size = diameter(np.concatenate(checked))
        grid = 1e-10 * size  # corners are put on it first: a union alone that does so may leave slivers
        snapped = shapely.set_precision([shapely.Polygon(p) for p in checked], grid)
        parts = shapely.get_parts(shapely.union_all(snapped, grid_size=grid))
        what = "pieces whose union is one polygon"
        require(
            len(parts) == 1, "object.pieces", what, "parts that do not join along edges", "let them overlap"
        )
        holes = len(parts[0].interiors)
        require(
            holes == 0, "object.pieces", what, f"{holes} hole(s) in it", "a caged object must have no hole"
        )
        outline = shapely.simplify(parts[0], 1e-9 * size).exterior
        return cls(vertices=np.array(outline.coords)[:-1], pieces=tuple(checked))

    @cached_property
    def size(self) -> float:
        """Diameter [m]."""
        return diameter(self.vertices)


def _convex_piece(vertices: object, k: int) -> Array:
    name = f"object.pieces[{k}]"
    piece = simple_polygon(vertices, field=name)
    require(is_convex(piece), name, "a convex polygon", "a reflex corner", "split it")
    return piece


def _require_cover(polygon: shapely.Polygon, pieces: tuple[Array, ...]) -> None:
    """Pieces must neither miss a part of the object nor reach outside: a bad cover makes false cages."""
    union = shapely.union_all([shapely.Polygon(p) for p in pieces])
    for excess, complaint in (
        (union.difference(polygon), "pieces that reach outside it"),
        (polygon.difference(union), "pieces that do not cover it"),
    ):
        small = excess.area <= COVER_TOLERANCE * polygon.area
        require(small, "object.pieces", "a cover of the object", f"{complaint} by {excess.area:.3g} m^2")


def wall_segments(walls: object) -> Array:
    """Checked segments (W, 2 ends, 2) [m].  Raises InvalidProblem."""
    listed = np.empty((0, 2, 2)) if walls is None or np.size(walls) == 0 else walls  # type: ignore[arg-type]
    segments = readonly(listed, (None, 2, 2), "walls")
    for k, (a, b) in enumerate(segments):
        require(bool((a != b).any()), f"walls[{k}]", "two different ends", "a point")
    return segments


@dataclass(frozen=True, kw_only=True)
class Arrangement:
    """An object at a pose (3,) among fingers (N, 2) and walls (W, 2, 2): is it caged?

    Raises InvalidProblem for fewer than two fingers, and for fingers or walls inside the object.
    """

    shape: Shape
    pose: Array
    fingers: Array
    walls: Array = field(default_factory=lambda: np.empty((0, 2, 2)))

    def __post_init__(self) -> None:
        object.__setattr__(self, "pose", readonly(self.pose, (3,), "pose"))
        object.__setattr__(self, "fingers", readonly(self.fingers, (None, 2), "fingers.positions"))
        object.__setattr__(self, "walls", wall_segments(self.walls))
        count = len(self.fingers)
        require(count >= 2, "fingers.positions", "at least 2 fingers", count, "one point cannot cage")
        inside = signed_distance(self.shape.vertices, to_body(self.pose, self.fingers))
        for k, distance in enumerate(inside):
            require(
                distance >= -self.start_tolerance,
                f"fingers.positions[{k}]",
                "a point outside the object",
                f"one {-distance:.3g} m inside it",
                "move the finger or the pose",
            )
        require_walls_outside(self.shape, self.pose, self.walls)

    @property
    def start_tolerance(self) -> float:
        """Depth [m] to which obstacles may enter the object at its start pose."""
        return START_TOLERANCE * self.shape.size


def require_walls_outside(shape: Shape, pose: Array, walls: Array) -> None:
    """Raise InvalidProblem for a wall that enters the object."""
    core = shapely.Polygon(shape.vertices).buffer(-START_TOLERANCE * shape.size, join_style="mitre")
    for k, ends in enumerate(walls):
        crosses = core.intersects(shapely.LineString(to_body(pose, ends)))
        require(not crosses, f"walls[{k}]", "a segment outside the object", "one that enters it", "move it")


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


CageCost = Literal["none", "min_separation", "max_opening"]
HalfRanges = tuple[tuple[float, float], ...]


@dataclass(frozen=True, kw_only=True)
class CageProblem:
    """Where do `count` fingers, on top of the fixed ones, cage the object at this pose? (Thesis 5.1)

    fewest: count is then the most fingers there are, and as few of them are used as the search can do with.
    margin: clearance that each condition keeps, relative to the object's diameter.
    rotation: pairs (below, above) of the half-ranges [rad] to try about the pose, in order; empty: the default ladder.
    parallel: all grippers open along one common direction, in world [rad], or searched where direction is None.
    """

    shape: Shape
    pose: Array
    count: int
    fewest: bool = False
    fixed: Array = field(default_factory=lambda: np.empty((0, 2)))
    walls: Array = field(default_factory=lambda: np.empty((0, 2, 2)))
    grippers: tuple[Gripper, ...] = ()
    parallel: bool = False
    direction: float | None = None
    cost: CageCost = "none"
    margin: float = 0.002
    rotation: HalfRanges = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "pose", readonly(self.pose, (3,), "pose"))
        fixed = readonly(np.reshape(self.fixed, (-1, 2)), (None, 2), "fingers.fixed")
        object.__setattr__(self, "fixed", fixed)
        object.__setattr__(self, "walls", wall_segments(self.walls))
        self._require_counts()
        self._require_ranges()
        inside = signed_distance(self.shape.vertices, to_body(self.pose, fixed))
        for k, distance in enumerate(inside):
            outside = distance >= -START_TOLERANCE * self.shape.size
            require(outside, f"fingers.fixed[{k}]", "a point outside the object", "one inside it")
        require_walls_outside(self.shape, self.pose, self.walls)

    def _require_counts(self) -> None:
        require(self.count >= 0, "fingers.count", "a number >= 0", self.count)
        total = self.count + len(self.fixed)
        require(total >= 2, "fingers", "at least 2 fingers, fixed ones included", total)
        alone = not (self.fewest and self.grippers)
        require(alone, "fingers.fewest", "false with grippers, which name their fingers", "true")
        for gripper in self.grippers:
            known = max(gripper.fingers) < self.count
            require(known, "fingers.grippers", f"indices from 0 to {self.count - 1}", list(gripper.fingers))

    def _require_ranges(self) -> None:
        require(0 < self.margin < 0.1, "options.margin", "a fraction between 0 and 0.1", self.margin)
        if self.direction is not None:
            known = self.parallel and bool(np.isfinite(self.direction))
            require(known, "fingers.direction", "a finite angle, and parallel: true", self.direction)
        for below, above in self.rotation:
            fits = 0 < below < np.pi and 0 < above < np.pi
            got = f"[{-np.degrees(below):g}, {np.degrees(above):g}] deg"
            require(fits, "options.rotation", "ranges around the pose, each side between 0 and 180 deg", got)
        if self.cost not in ("none", "min_separation", "max_opening"):
            raise InvalidProblem("cost", expected="none, min_separation or max_opening", got=str(self.cost))
        if self.cost == "max_opening":
            fits = self.count in (2, 3) and not self.fewest
            got = f"{self.count} fingers" + (" or fewer" if self.fewest else "")
            require(fits, "cost", "max_opening with 2 or 3 searched fingers", got, "choose another cost")

    def arrangement(self, fingers: Array) -> Arrangement:
        """The object among searched fingers (count, 2), fixed fingers and walls."""
        return Arrangement(
            shape=self.shape,
            pose=self.pose,
            fingers=np.concatenate([np.reshape(fingers, (-1, 2)), self.fixed]),
            walls=self.walls,
        )
