"""What can be reached while fingers move from one place to the next: a flood over cells of orientation, from outside.

In a slab [low, high] of the path parameter the fingers stay within half their motion of the middle, so obstacles eroded
by that much are obstacles throughout.  The components of what is left contain every free configuration of the slab, and
a motion passes from cell to cell at a configuration that both contain.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import count

import numpy as np
import shapely

from expert.budget import Budget
from expert.geometry.pose import Array, wrapped
from expert.verify.cage.cells import TURN, Cell, CellComplex
from expert.verify.cage.search import UNIT
from expert.verify.grasp.finger_path import FingerPath

Node = tuple[Cell, int]
Reached = dict[Cell, list[shapely.Polygon]]


def signed_bounds(cell: Cell) -> tuple[float, float]:
    """First and last orientation [rad] of a cell, within half a turn of the goal."""
    start = cell.start - TURN if cell.start >= TURN // 2 else cell.start
    return start * UNIT, (start + cell.width) * UNIT


def reach(cell: Cell) -> float:
    """Largest deviation from the goal's orientation [rad]."""
    low, high = signed_bounds(cell)
    return max(-low, high)


def uniform_ring(width: int) -> list[Cell]:
    """All orientations in cells of one width, in order."""
    return [Cell(start, width) for start in range(0, TURN, width)]


def coarsened(ring: list[Cell], most: int) -> list[Cell]:
    """Cells that were halved are joined again, once, up to a width."""
    joined: list[Cell] = []
    for cell in ring:
        last = joined[-1] if joined else None
        siblings = last is not None and last.width == cell.width and last.start % (2 * cell.width) == 0
        if last is not None and siblings and last.start + last.width == cell.start and 2 * cell.width <= most:
            joined[-1] = Cell(last.start, 2 * cell.width)
        else:
            joined.append(cell)
    return joined


@dataclass(frozen=True)
class Slab:
    """Path parameters [low, high], the cells used, and what can be reached: polygons of positions by cell."""

    low: float
    high: float
    ring: list[Cell]
    reached: Reached

    @property
    def range(self) -> tuple[float, float]:
        """Orientations reached [rad], relative to the goal."""
        bounds = [signed_bounds(cell) for cell in self.reached]
        return min(b[0] for b in bounds), max(b[1] for b in bounds)

    @property
    def shift(self) -> float:
        """Largest relative distance of a position reached from the goal."""
        corners = shapely.get_coordinates([p for polygons in self.reached.values() for p in polygons])
        return float(np.linalg.norm(corners, axis=1).max())

    def meets(self, first: Array, last: Array) -> bool:
        """Whether it holds a configuration between two (3,) with one orientation."""
        line, angle = segment(first, last), wrapped(first[2])
        for cell, polygons in self.reached.items():
            low, high = signed_bounds(cell)
            near = low - 1e-7 <= angle <= high + 1e-7
            if near and (shapely.distance(polygons, line) <= 1e-6).any():
                return True
        return False


def segment(first: Array, last: Array) -> shapely.Geometry:
    """Positions between two configurations."""
    same = bool((first[:2] == last[:2]).all())
    return shapely.Point(first[:2]) if same else shapely.LineString([first[:2], last[:2]])


class SlabFlood:
    """Components of one slab, in cells of a ring, and a flood through them.

    window: what is reached beyond this box of relative positions counts as unbounded; a small one saves time.
    """

    def __init__(
        self,
        path: FingerPath,
        low: float,
        high: float,
        ring: list[Cell],
        window: shapely.Polygon | None,
        budget: Budget,
    ) -> None:
        motion = float(np.linalg.norm(path.fingers(high) - path.fingers(low), axis=1).max())
        self.low, self.high, self.on_grid = low, high, False
        self.slack = 0.5 * motion
        middle = path.arrangement(0.5 * (low + high))
        self.space = CellComplex(middle, self.slack * path.frame.radius, window=window, budget=budget)
        self.ring = ring
        self.came_from: dict[Node, Node | None] = {}

    def repeat_on_grid(self) -> None:
        """Use overlays on a grid, robust and slower, from now on."""
        self.space, self.on_grid = self.space.on_grid(), True

    def flood(self, sources: Reached, limit: float, avoid: Array) -> list[Node] | None:
        """Fill from what is known to be entered; a way to where the object is not held, if there is one.

        sources: cells of any ring, with geometries.  limit [rad]: orientations beyond it count as not held.
        avoid: so do components with one of these configurations (M, 3).
        The outermost orientations come first: mostly they show early that the object is not held.
        """
        order = {cell: k for k, cell in enumerate(self.ring)}
        waiting = _Waiting()
        self.came_from = {}
        for cell, shapes in self._matched(sources):
            waiting.push(cell, np.array(shapes), None)
        while waiting.entries:
            cell, entries, origin = waiting.pop()
            beside = (self.ring[order[cell] - 1], self.ring[(order[cell] + 1) % len(self.ring)])
            for node in self._entered(cell, entries):
                self.came_from[node] = origin
                parts, k = self.space.inner(cell), node[1]
                if parts.unbounded[k] or reach(cell) > limit or _holds_any(cell, parts.polygons[k], avoid):
                    return self._way(node)
                for other in beside:
                    waiting.push(other, parts.polygons[k : k + 1], node)
        return None

    def _entered(self, cell: Cell, entries: np.ndarray) -> list[Node]:
        """New components of a cell that touch any of the geometries."""
        polygons = self.space.inner(cell).polygons
        fresh = [k for k in range(len(polygons)) if (cell, k) not in self.came_from]
        if not fresh:
            return []
        met = shapely.intersects(polygons[fresh][:, None], entries[None]).any(axis=1)
        return [(cell, fresh[k]) for k in np.flatnonzero(met)]

    def _matched(self, sources: Reached) -> Iterable[tuple[Cell, list[shapely.Geometry]]]:
        """Sources, by the cells of this ring whose orientations overlap theirs."""
        starts = np.array([cell.start for cell in self.ring])
        ends = starts + [cell.width for cell in self.ring]
        matched: dict[Cell, list[shapely.Geometry]] = {}
        for cell, shapes in sources.items():
            inside = (starts < cell.start + cell.width) & (ends > cell.start)
            for k in np.flatnonzero(inside):
                matched.setdefault(self.ring[k], []).extend(shapes)
        return matched.items()

    def _way(self, node: Node) -> list[Node]:
        way, current = [], self.came_from[node]
        way.append(node)
        while current is not None:
            way.append(current)
            current = self.came_from[current]
        return way

    def leaks_anyway(self, cell: Cell) -> bool:
        """Whether the goal's position is in the unbounded component even at one orientation of a cell."""
        parts = self.space.inner(Cell(cell.start + cell.width // 2, 0))
        around = shapely.intersects(parts.polygons, shapely.Point(0, 0))
        return any(parts.unbounded[k] for k in np.flatnonzero(around))

    def split(self, cells: set[Cell]) -> None:
        """Halve cells of the ring."""
        halves = (
            (Cell(c.start, c.width // 2), Cell(c.start + c.width // 2, c.width // 2)) for c in self.ring
        )
        self.ring = [
            part for c, pair in zip(self.ring, halves, strict=True) for part in (pair if c in cells else (c,))
        ]

    def slab(self) -> Slab:
        """What the last flood reached."""
        reached: Reached = {}
        for cell, k in self.came_from:
            reached.setdefault(cell, []).append(self.space.inner(cell).polygons[k])
        return Slab(self.low, self.high, self.ring, reached)


def _holds_any(cell: Cell, polygon: shapely.Polygon, configurations: Array) -> bool:
    """Whether any of the configurations (M, 3) is in a component of a cell."""
    low, high = signed_bounds(cell)
    x, y, angle = configurations[:, 0], configurations[:, 1], wrapped(configurations[:, 2])
    inside = (low <= angle) & (angle <= high)
    return bool(inside.any() and shapely.intersects_xy(polygon, x[inside], y[inside]).any())


class _Waiting:
    """Cells to be entered through geometries, the outermost orientation first."""

    def __init__(self) -> None:
        self.entries: list[tuple[float, int, Cell, np.ndarray, Node | None]] = []
        self._number = count()

    def push(self, cell: Cell, geometries: np.ndarray, origin: Node | None) -> None:
        heappush(self.entries, (-reach(cell), next(self._number), cell, geometries, origin))

    def pop(self) -> tuple[Cell, np.ndarray, Node | None]:
        return heappop(self.entries)[2:]
