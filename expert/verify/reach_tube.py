"""Where an object can be while fingers move: a flood forward over slabs of the path parameter, from outside.

In a slab [low, high] the fingers stay within half their motion of the middle, so obstacles eroded by that much are
obstacles throughout; cells of orientation are those of the cage verifier.  The components of what is left contain every
free configuration of the slab, and a motion passes from slab to slab at a configuration that both contain.  Everything
reached is an outer bound; slabs and cells are halved where the flood leaves the orientations allowed or is unbounded.
"""

import itertools
import time
from collections import deque
from dataclasses import dataclass, field

import numpy as np
import shapely

from expert.geometry.pose import Array
from expert.verify.cage_search import UNIT
from expert.verify.cspace_cells import TURN, Cell, CellComplex
from expert.verify.finger_path import FingerPath

FINEST = 1
"""Smallest width of a cell, in units of the cage verifier."""


@dataclass(frozen=True)
class Slab:
    """Path parameters [low, high] and what can be reached in them: polygons by cell of orientation."""

    low: float
    high: float
    reached: dict[Cell, list[shapely.Polygon]]

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
        line = (
            shapely.LineString([first[:2], last[:2]]) if (first != last).any() else shapely.Point(first[:2])
        )
        angle = (first[2] + np.pi) % (2 * np.pi) - np.pi
        for cell, polygons in self.reached.items():
            low, high = signed_bounds(cell)
            if low - 1e-7 <= angle <= high + 1e-7 and (shapely.distance(polygons, line) <= 1e-6).any():
                return True
        return False


def signed_bounds(cell: Cell) -> tuple[float, float]:
    """First and last orientation [rad] of a cell, within half a turn of the goal."""
    start = cell.start - TURN if cell.start >= TURN // 2 else cell.start
    return start * UNIT, (start + cell.width) * UNIT


@dataclass
class Tube:
    """Slabs in order of s.  leak: parameters (low, high) of a slab from which the flood leaves at the finest resolution."""

    slabs: list[Slab] = field(default_factory=list)
    leak: tuple[float, float] | None = None

    @property
    def closed(self) -> bool:
        """Whether everything reached stays bounded and within the orientations allowed."""
        return self.leak is None

    def meets(self, s: float, first: Array, last: Array) -> bool:
        """Whether a configuration between two may be reached at s."""
        return any(
            slab.low - 1e-7 <= s <= slab.high + 1e-7 and slab.meets(first, last) for slab in self.slabs
        )


class Flood:
    """One flood: `width` units per cell and slabs of matching length to begin with, halved up to `depth` times.

    limit [rad]: orientations farther from the goal count as leaking.  until: processor seconds that a run may take.
    """

    def __init__(
        self, path: FingerPath, limit: float, *, width: int, depth: int, until: float = np.inf
    ) -> None:
        self.path, self.limit, self.width, self.depth = path, limit, width, depth
        self.deadline = time.process_time() + until

    def run(self) -> Tube:
        """Flood from the goal's component at s = 0 to the end."""
        tube = Tube()
        before: Slab | None = None
        for k in range(len(self.path.knots) - 1):
            count = max(1, int(np.ceil(self._motion(k, k + 1) / (self.width * UNIT))))
            stops = k + np.linspace(0, 1, count + 1)
            for low, high in itertools.pairwise(stops):
                if not self._advance(tube, before, float(low), float(high), self.width, self.depth):
                    return tube
                before = tube.slabs[-1]
        return tube

    def _advance(
        self, tube: Tube, before: Slab | None, low: float, high: float, width: int, depth: int
    ) -> bool:
        """Append slabs that cover [low, high]; False and a leak if that fails."""
        slab = self.slab(before, low, high, width)
        if slab is not None:
            tube.slabs.append(slab)
            return True
        if depth == 0 or time.process_time() > self.deadline:
            tube.leak = low, high
            return False
        middle, finer = 0.5 * (low + high), max(FINEST, width // 2)
        if not self._advance(tube, before, low, middle, finer, depth - 1):
            return False
        return self._advance(tube, tube.slabs[-1], middle, high, finer, depth - 1)

    def _motion(self, low: float, high: float) -> float:
        """Largest distance that a finger goes, within one segment."""
        return float(np.linalg.norm(self.path.fingers(high) - self.path.fingers(low), axis=1).max())

    def slab(self, before: Slab | None, low: float, high: float, width: int) -> Slab | None:
        """What is reached in [low, high] from a slab before it (None: from the goal), or None if that is not held."""
        slack = 0.5 * self._motion(low, high) * self.path.frame.radius
        cells = CellComplex(self.path.arrangement(0.5 * (low + high)), slack, on_grid=True)
        queue: deque[tuple[Cell, int]] = deque()
        seen: set[tuple[Cell, int]] = set()

        def enter(cell: Cell, polygons: list[shapely.Polygon]) -> None:
            met = shapely.intersects(cells.inner(cell).polygons[:, None], np.array(polygons)[None]).any(
                axis=1
            )
            for k in np.flatnonzero(met):
                if (cell, int(k)) not in seen:
                    seen.add((cell, int(k)))
                    queue.append((cell, int(k)))

        for cell, polygons in _sources(before, width):
            enter(cell, polygons)
        while queue:
            cell, k = queue.popleft()
            least, most = signed_bounds(cell)
            if cells.inner(cell).unbounded[k] or max(-least, most) > self.limit:
                return None
            polygon = cells.inner(cell).polygons[k]
            for start in (cell.start - width, cell.start + width):
                enter(Cell(start % TURN, width), [polygon])
        reached: dict[Cell, list[shapely.Polygon]] = {}
        for cell, k in seen:
            reached.setdefault(cell, []).append(cells.inner(cell).polygons[k])
        return Slab(low, high, reached)


def _sources(before: Slab | None, width: int) -> list[tuple[Cell, list[shapely.Polygon]]]:
    """Cells of a new width, each with the polygons that a slab before reached in overlapping cells."""
    if before is None:
        return [(Cell(start % TURN, width), [shapely.Point(0, 0)]) for start in (0, -width)]
    sources: dict[Cell, list[shapely.Polygon]] = {}
    for cell, polygons in before.reached.items():
        first = cell.start // width * width
        for start in range(first, cell.start + cell.width, width):
            sources.setdefault(Cell(start % TURN, width), []).extend(polygons)
    return list(sources.items())
