"""Search for an escape, or for a bounded part of free space that holds the start, over cells of orientation.

Cells are refined where inner and outer components disagree about one candidate escape.
"""

import itertools
from collections import deque
from typing import Literal

import numpy as np
import shapely

from expert.budget import UNLIMITED, Budget
from expert.geometry.pose import Array
from expert.problems.cage import Arrangement
from expert.verify.cage.cells import COARSEST, START, TURN, Cell, CellComplex, Components
from expert.verify.cage.escape import escape_fault
from expert.verify.cage.escape_path import Leg, escape_path

Node = tuple[Cell, int]
Verdict = Literal["caged", "escapes", "unknown"]
UNIT = 2 * np.pi / TURN
"""[rad]."""
MOST_ROUNDS, PATIENCE = 300, 40
"""Refinements before giving up; after PATIENCE of them the doubt is a long corridor, and cells are split to an eighth."""


class CageSearch:
    """Cells in cyclic order (`ahead`, `behind`) and floods through their inner and outer components."""

    def __init__(
        self,
        arrangement: Arrangement,
        slack: float,
        finest: int,
        budget: Budget = UNLIMITED,
        *,
        on_grid: bool = False,
    ) -> None:
        self.arrangement = arrangement
        self.finest = finest
        self.complex = CellComplex(arrangement, slack, on_grid=on_grid, budget=budget)
        ring = [START, *(Cell(s, COARSEST) for s in range(0, TURN, COARSEST)), START]
        self.ahead = dict(itertools.pairwise(ring))
        self.behind = {b: a for a, b in self.ahead.items()}
        self.reached: set[Cell] = set()
        self.past_finest = True
        self.faults = 0
        self._links: dict[tuple, list[list[int]]] = {}

    def run(
        self, range_resolution: float, cell_budget: int, within: tuple[float, float] | None = None
    ) -> tuple[Verdict, Array]:
        """Refine until a flood of the inner components stays bounded or one of the outer components escapes.

        within [rad], relative to the start: a cage that seems to reach beyond is refined where it leaves this range.
        Raises OutOfTime.
        """
        nowhere = np.empty((0, 3))
        for turn in range(MOST_ROUNDS):
            if self.complex.evaluated >= cell_budget:
                break
            route = self.candidate_escape()
            if route is None:
                blunt = self.blunt_ends(range_resolution)
                blunt |= self.leading_beyond(within) if within is not None and not blunt else set()
                if not blunt:
                    return "caged", nowhere
                self.split(blunt)
                continue
            for cell, _ in route:
                self.complex.outer(cell)
            inside = self.outer_flood(self.outer_starts())
            if (path := self.checked_path(inside)) is not None:
                return "escapes", path
            divisible = {c for c in self.doubtful_cells(route, inside) if c.width > self.finest}
            if not divisible:
                break
            self.split(divisible, times=1 if turn < PATIENCE else 3)
        return "unknown", nowhere

    def holds_on_grid(self) -> bool:
        """Whether the last flood stays bounded when the same cells are computed with robust overlays."""
        self.complex = self.complex.on_grid()
        self._links.clear()
        return self.flood() is None

    def split(self, cells: set[Cell], times: int = 1) -> None:
        """Halve cells so many times, or until they are finest."""
        for cell in cells:
            half = cell.width // 2
            low, high = Cell(cell.start, half), Cell(cell.start + half, half)
            before, after = self.behind.pop(cell), self.ahead.pop(cell)
            for a, b in ((before, low), (low, high), (high, after)):
                self.ahead[a], self.behind[b] = b, a
            if times > 1 and half > self.finest:
                self.split({low, high}, times - 1)

    def parts(self, cell: Cell) -> Components:
        """Inner components, or outer ones of cells that cannot be split where a way past their doubt is sought."""
        past = self.past_finest and cell.width <= self.finest
        return self.complex.outer(cell) if past else self.complex.inner(cell)

    def candidate_escape(self) -> list[Node] | None:
        """A way to infinity that further splitting can decide, if there is one, else any way; None: there is none."""
        self.past_finest = True
        route = self.flood()
        if route is None:
            self.past_finest = False
            route = self.flood()
        return route

    def flood(self, beyond: frozenset[Cell] = frozenset()) -> list[Node] | None:
        """Components from the start to infinity or into cells `beyond`, neighbours in touch, or None.

        `reached` are the cells seen.
        """
        at_start = shapely.intersects(self.parts(START).polygons, shapely.Point(0, 0))
        queue = deque((START, int(k)) for k in np.flatnonzero(at_start))
        came_from: dict[Node, Node | None] = dict.fromkeys(queue)
        self.reached = {START}
        while queue:
            cell, k = queue.popleft()
            self.reached.add(cell)
            if cell in beyond or self.parts(cell).unbounded[k]:
                return _trace(came_from, (cell, k))
            for neighbour in {self.ahead[cell], self.behind[cell]}:
                for j in self.links(cell, neighbour)[k]:
                    following = (neighbour, j)
                    if following not in came_from:
                        came_from[following] = (cell, k)
                        queue.append(following)
        return None

    def links(self, a: Cell, b: Cell) -> list[list[int]]:
        """For each component of a those of b that touch it: a motion may pass at the orientation between the cells."""
        key = (a, b, self.past_finest)
        if key not in self._links:
            met = shapely.intersects(self.parts(a).polygons[:, None], self.parts(b).polygons[None])
            self._links[key] = [np.flatnonzero(row).tolist() for row in met]
            self._links[b, a, self.past_finest] = [np.flatnonzero(row).tolist() for row in met.T]
        return self._links[key]

    def outer_starts(self) -> list[Node]:
        """Outer components of the start orientation that the start pose lies in, or touches within its tolerance."""
        polygons = self.complex.outer(START).polygons
        near = shapely.distance(polygons, shapely.Point(0, 0))
        within = self.arrangement.start_tolerance / self.complex.frame.radius
        return [(START, int(k)) for k in np.flatnonzero(near <= within)]

    def outer_flood(self, starts: list[Node]) -> dict[Node, Node | None]:
        """Outer components that can be reached from `starts` within the cells looked at, with their predecessors."""
        came_from: dict[Node, Node | None] = dict.fromkeys(starts)
        queue = deque(starts)
        while queue:
            cell, k = queue.popleft()
            for neighbour in {self.ahead[cell], self.behind[cell]}:
                if not self.complex.has_outer(neighbour):
                    continue
                for j in self.complex.passages(cell, neighbour)[k]:
                    following = (neighbour, j)
                    if following not in came_from:
                        came_from[following] = (cell, k)
                        queue.append(following)
        return came_from

    def checked_path(self, inside: dict[Node, Node | None]) -> Array | None:
        """Body poses of an escape through outer components, if there is one and it passes the exact check."""
        free = (node for node in inside if self.complex.outer(node[0]).unbounded[node[1]])
        end = next(free, None)
        if end is None:
            return None
        nodes = _trace(inside, end)
        legs = [
            Leg(cell.bounds, self.complex.outer(cell).polygons[k], self._passage(cell, k, following))
            for (cell, k), following in zip(nodes, [*nodes[1:], None], strict=True)
        ]
        path = self.complex.frame.world_pose(escape_path(legs, self.complex.box))
        if escape_fault(self.arrangement, path) is None:
            return path
        self.faults += 1
        return None

    def _passage(self, cell: Cell, k: int, following: Node | None) -> shapely.Geometry | None:
        return self.complex.passages(cell, following[0])[k][following[1]] if following else None

    def doubtful_cells(self, route: list[Node], inside: dict[Node, Node | None]) -> list[Cell]:
        """Cells of a route between the last place shown reachable and the first one shown to lead to infinity."""
        cells = [cell for cell in self.ahead if self.complex.has_outer(cell)]
        exits = [(c, k) for c in cells for k, far in enumerate(self.complex.outer(c).unbounded) if far]
        from_start, to_infinity = self._containing(inside), self._containing(self.outer_flood(exits))
        came = [k for k, node in enumerate(route) if node in from_start]
        goes = [k for k, node in enumerate(route) if node in to_infinity]
        last, first = max(came, default=0), min(goes, default=len(route) - 1)
        return [cell for cell, _ in route[min(last, first) : max(last, first) + 1]]

    def _containing(self, flood: dict[Node, Node | None]) -> set[Node]:
        """The components, in the sense of `parts`, that contain flooded outer components."""
        past = self.past_finest
        return {
            (cell, j if past and cell.width <= self.finest else self.complex.within(cell)[j])
            for cell, j in flood
        }

    def blunt_ends(self, resolution: float) -> set[Cell]:
        """First and last reached cells where they are wider than the resolution."""
        if len(self.reached) == len(self.ahead):
            return set()
        ends = {self._last(self.ahead), self._last(self.behind)}
        return {c for c in ends if c.width > max(resolution / UNIT, self.finest)}

    def leading_beyond(self, within: tuple[float, float]) -> set[Cell]:
        """Cells that may be halved on the way to orientations outside `within`."""
        low, high = within
        outside = frozenset(
            c for c in self.reached if c.bounds[0] >= high - 1e-9 and c.bounds[1] <= 2 * np.pi + low + 1e-9
        )
        seen = self.reached
        route = self.flood(outside) if outside else None
        self.reached = seen
        return {cell for cell, _ in route or [] if cell.width > self.finest}

    def shown_beyond(self, within: tuple[float, float]) -> bool:
        """Whether the object is shown to reach orientations outside `within` [rad], relative to the start."""
        low, high = within

        def is_beyond(cell: Cell) -> bool:
            return bool(cell.width) and cell.bounds[0] > high and cell.bounds[1] < 2 * np.pi + low

        if not any(map(is_beyond, self.reached)):
            return False
        for cell in self.reached:
            self.complex.outer(cell)
        return any(is_beyond(cell) for cell, _ in self.outer_flood(self.outer_starts()))

    def _last(self, onward: dict[Cell, Cell]) -> Cell:
        cell = START
        while onward[cell] in self.reached:
            cell = onward[cell]
        return cell

    def rotation_range(self) -> tuple[float, float]:
        """Orientations of the cells reached [rad], world."""
        if len(self.reached) == len(self.ahead):
            return -np.inf, np.inf
        low, high = self._last(self.behind), self._last(self.ahead)
        first = low.bounds[0] - 2 * np.pi if low.width else 0.0
        theta = float(self.arrangement.pose[2])
        return theta + first, theta + high.bounds[1]


def _trace(came_from: dict[Node, Node | None], node: Node) -> list[Node]:
    nodes: list[Node] = []
    current: Node | None = node
    while current is not None:
        nodes.append(current)
        current = came_from[current]
    return nodes[::-1]
