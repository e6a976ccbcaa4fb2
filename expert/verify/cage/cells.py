"""Free configuration space over small ranges of orientation, from inside and from outside.

All lengths are relative: the object's reference point (centre of its enclosing circle) is its origin, the circle's
radius is 1, and the start pose is the origin of configuration space.  A cell is a range of orientation of half-width h
about a middle m.  Its shapes, turned by m, hold for every orientation in the cell:

inner shape   a convex piece {y : n_k . y <= d_k} shrinks to {R(+-h) n_k . y <= d_k} and, where d_k > 0,
              {n_k . y <= d_k cos h}: the points that stay inside the piece while it turns by up to h either way;
outer shape   the hull of R(+-h) v and v / cos h over the corners v: every arc of a corner, hence the turning piece.

`docs/theory/caging.md` proves both.  Obstacles made of inner shapes leave too much free space, those of outer shapes too little.
"""

from dataclasses import dataclass
from functools import lru_cache, partial, reduce
from typing import Any, NamedTuple

import numpy as np
import shapely

from expert.budget import UNLIMITED, Budget
from expert.errors import OutOfTime
from expert.geometry.cover import clip, half_planes, overlapping_cover
from expert.geometry.polygon import simple_polygon
from expert.geometry.pose import Array, rotation
from expert.problems.cage import Arrangement
from expert.verify.cage.parts import TOLERANCE, inside_parts
from expert.world.frame import Frame

INNER_MARGIN = 1e-6
"""Inner shapes are eroded by this, so that neither rounding, nor parts that reach outside by their tolerance, nor the start
tolerance can turn an escape into a cage."""
DEGREE = 256
"""Cell bounds are whole units of 1/256 degree beyond the start orientation."""
TURN = 360 * DEGREE
COARSEST = 8 * DEGREE
"""Width of a cell before refinement."""

GRID = 1e-9
"""Overlays may move corners by this: far less than INNER_MARGIN and than the tolerance of the exact path check."""

Geometries = np.ndarray[tuple[int, ...], np.dtype[Any]]


class Cell(NamedTuple):
    """Orientations from `start` to `start + width` units of 1 / DEGREE; the start orientation alone is a cell of width 0."""

    start: int
    width: int

    @property
    def bounds(self) -> tuple[float, float]:
        """First and last orientation relative to the start [rad]."""
        return self.start * 2 * np.pi / TURN, (self.start + self.width) * 2 * np.pi / TURN

    @property
    def half_width(self) -> float:
        """[rad]."""
        return self.width * np.pi / TURN


START = Cell(0, 0)


@dataclass(frozen=True)
class Components:
    """Connected parts of a cell's free space (polygons) and which of them reach to infinity."""

    polygons: Geometries
    unbounded: list[bool]


@dataclass(frozen=True)
class SweptShape:
    """Convex parts and their union for all orientations within half-width h of zero."""

    parts: tuple[Array, ...]
    union: shapely.Geometry
    corners: Array


class CellComplex:
    """Free components of the cells of one arrangement, computed when asked for and kept.

    slack: inner shapes are eroded by this length [m] more, so that they stay obstacles wherever fingers move by less.
    window: a box of relative positions; what leaves it counts as unbounded (default: far beyond all obstacles).
    on_grid: overlays on a grid of GRID, robust and slower, instead of in plain doubles.
    budget: once it is over, asking for another cell raises OutOfTime.
    """

    def __init__(
        self,
        arrangement: Arrangement,
        slack: float = 0.0,
        *,
        window: shapely.Polygon | None = None,
        on_grid: bool = False,
        budget: Budget = UNLIMITED,
    ) -> None:
        self._arrangement, self._slack, self._window, self._budget = arrangement, slack, window, budget
        self._grid = GRID if on_grid else None
        self.frame = Frame.of(arrangement.shape, arrangement.pose)
        self.fingers = self.frame.relative(arrangement.fingers)
        self.walls = self.frame.relative(arrangement.wall_ends)
        self._vertices = arrangement.shape.vertices
        self._erosion = INNER_MARGIN + slack / self.frame.radius
        self.box = window or self._far_box()
        self._inner: dict[Cell, Components] = {}
        self._outer: dict[Cell, Components] = {}
        self._within: dict[Cell, list[int]] = {}
        self._passages: dict[tuple[Cell, Cell], list[dict[int, shapely.Geometry]]] = {}

    def on_grid(self) -> "CellComplex":
        """The same cells, not yet computed, on a grid."""
        return CellComplex(
            self._arrangement, self._slack, window=self._window, on_grid=True, budget=self._budget
        )

    def _far_box(self) -> shapely.Polygon:
        obstacles = np.concatenate([self.fingers, self.walls.reshape(-1, 2), np.zeros((1, 2))])
        return shapely.box(*(obstacles.min(axis=0) - 2.5), *(obstacles.max(axis=0) + 2.5))

    @property
    def evaluated(self) -> int:
        """How many cells were looked at."""
        return len(self._inner.keys() | self._outer.keys())

    def inner(self, cell: Cell) -> Components:
        """Components outside the inner obstacles: every free configuration of the cell is in one of them."""
        if cell not in self._inner:
            self._inner[cell] = self._free(cell, self._inner_shape(cell.half_width))
        return self._inner[cell]

    def outer(self, cell: Cell) -> Components:
        """Components outside the outer obstacles: free at every orientation of the cell."""
        if cell not in self._outer:
            self._outer[cell] = self._free(cell, self._outer_shape(cell.half_width))
        return self._outer[cell]

    def has_outer(self, cell: Cell) -> bool:
        """Whether `outer` was asked for this cell."""
        return cell in self._outer

    def within(self, cell: Cell) -> list[int]:
        """For each outer component the inner one that contains it."""
        if cell not in self._within:
            outer, inner = self.outer(cell).polygons, self.inner(cell).polygons
            met = shapely.intersects(outer[:, None], inner[None])
            self._within[cell] = [int(k) for k in met.argmax(axis=1)] if len(outer) else []
        return self._within[cell]

    def passages(self, a: Cell, b: Cell) -> list[dict[int, shapely.Geometry]]:
        """For each outer component of a, by outer components of b: the positions they share, where those have area."""
        if (a, b) not in self._passages:
            first, second = self.outer(a).polygons, self.outer(b).polygons
            i, j = np.nonzero(shapely.intersects(first[:, None], second[None]))
            common = _common(first[i], second[j])
            forth: list[dict[int, shapely.Geometry]] = [{} for _ in first]
            back: list[dict[int, shapely.Geometry]] = [{} for _ in second]
            for m, n, shared, area in zip(i, j, common, shapely.area(common), strict=True):
                if area > 1e-12:
                    forth[m][int(n)] = back[n][int(m)] = shared
            self._passages[a, b], self._passages[b, a] = forth, back
        return self._passages[a, b]

    def _free(self, cell: Cell, shape: SweptShape) -> Components:
        if self._budget.over:
            raise OutOfTime("the budget was spent before all cells were known")
        obstacles = self._obstacles(shape, sum(cell.bounds) / 2)
        free = _outside(self.box, obstacles, self._grid, one_by_one=self._window is not None)
        polygons = shapely.get_parts(np.array([free]))
        polygons = polygons[~shapely.is_empty(polygons)]  # a window may be covered
        rim = np.abs(shapely.bounds(polygons) - shapely.bounds(self.box)) <= 1e-9
        return Components(polygons, rim.any(axis=1).tolist())

    def _inner_shape(self, half: float) -> SweptShape:
        return _inner_shape(*self._shape_key(), half, self._erosion)

    def _outer_shape(self, half: float) -> SweptShape:
        return _outer_shape(*self._shape_key(), half)

    def _shape_key(self) -> tuple[bytes, tuple[float, float], float]:
        return self._vertices.tobytes(), tuple(self.frame.centre), self.frame.radius

    def _obstacles(self, shape: SweptShape, angle: float) -> list[shapely.Geometry]:
        """p - R y over the shape for each finger; for each wall the hull of both ends' copies of each convex part."""
        turn = rotation(angle).T
        copies = np.repeat(np.array([shape.union]), len(self.fingers))
        moved = self.fingers[:, None] - (shape.corners @ turn)[None]
        obstacles = list(shapely.set_coordinates(copies, moved.reshape(-1, 2)))
        for part in shape.parts if len(self.walls) else ():
            corners = -(part @ turn)
            both_ends = (self.walls[:, :, None] + corners).reshape(len(self.walls), -1, 2)
            obstacles += [shapely.MultiPoint(points).convex_hull for points in both_ends]
        return obstacles


def _outside(
    box: shapely.Polygon, obstacles: list[shapely.Geometry], grid: float | None, one_by_one: bool
) -> shapely.Geometry:
    """Box minus obstacles; where doubles defeat the overlay outright, on the grid.

    one_by_one: overlays clip to the box, so cutting off each obstacle in turn pays where the box is small.
    """
    try:
        cut = obstacles if one_by_one else [shapely.union_all(obstacles, grid_size=grid)]
        return reduce(partial(shapely.difference, grid_size=grid), cut, box)
    except shapely.GEOSException:
        if grid is not None:
            raise
        return _outside(box, obstacles, GRID, one_by_one)


def _common(a: Geometries, b: Geometries) -> Geometries:
    """Pairwise intersections; the same remedy (escapes found through them are checked exactly)."""
    try:
        return shapely.intersection(a, b)
    except shapely.GEOSException:
        return shapely.intersection(a, b, grid_size=GRID)


@lru_cache(maxsize=64)
def _relative_cover(vertices: bytes, centre: tuple[float, float], radius: float) -> tuple[Array, ...]:
    return tuple(overlapping_cover(_relative_polygon(vertices, centre, radius)))


@lru_cache(maxsize=64)
def _sure_parts(vertices: bytes, centre: tuple[float, float], radius: float) -> tuple[Array, ...]:
    polygon = _relative_polygon(vertices, centre, radius)
    return tuple(inside_parts(polygon, _relative_cover(vertices, centre, radius)))


def _relative_polygon(vertices: bytes, centre: tuple[float, float], radius: float) -> Array:
    polygon = (np.frombuffer(vertices).reshape(-1, 2) - np.array(centre)) / radius
    return simple_polygon(polygon, field="object.vertices")


@lru_cache(maxsize=256)
def _inner_shape(
    vertices: bytes, centre: tuple[float, float], radius: float, half: float, erosion: float
) -> SweptShape:
    return _swept([inner_piece(part, half, erosion) for part in _sure_parts(vertices, centre, radius)])


@lru_cache(maxsize=256)
def _outer_shape(vertices: bytes, centre: tuple[float, float], radius: float, half: float) -> SweptShape:
    cover = _relative_cover(vertices, centre, radius)
    return _swept([outer_piece(piece, half) for piece in cover])


def _swept(parts: list[Array]) -> SweptShape:
    solid = tuple(part for part in parts if len(part) >= 3)
    union = shapely.union_all([shapely.Polygon(part) for part in solid], grid_size=GRID)
    union = shapely.simplify(union, GRID)  # corners a few ulps apart would make invalid copies when moved
    return SweptShape(solid, union, shapely.get_coordinates(union))


def inner_piece(piece: Array, half: float, erosion: float = 0.0) -> Array:
    """Convex subset (v, 2), possibly empty, of R(t) piece for all |t| <= half, eroded.

    Its corners are compared with the half-planes that cut it out: empty where the clipping failed.
    """
    normals, offsets = half_planes(piece)
    offsets = offsets - erosion
    convex = offsets > 0  # the arc of tangent points bulges outward: cut it by its chord
    cut_normals = np.concatenate([normals @ rotation(half).T, normals @ rotation(-half).T, normals[convex]])
    cut_offsets = np.concatenate([offsets, offsets, offsets[convex] * np.cos(half)])
    square = 2 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    part = clip(square, cut_normals, cut_offsets)
    return part if (part @ cut_normals.T <= cut_offsets + TOLERANCE).all() else part[:0]


def outer_piece(piece: Array, half: float) -> Array:
    """Convex superset (v, 2) of R(t) piece for all |t| <= half < 90 degrees."""
    points = np.concatenate([piece @ rotation(half).T, piece @ rotation(-half).T, piece / np.cos(half)])
    return np.array(shapely.MultiPoint(points).convex_hull.exterior.coords)[:-1]
