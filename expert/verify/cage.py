"""Is an object caged?  Independent of how the fingers were found; never claims what it has not shown.

CAGED    no motion leaves: the free space that inner obstacles leave, too large, keeps the start in a bounded part.
ESCAPES  an explicit path to infinity, whose every move `expert.verify.escape` has checked exactly.
UNKNOWN  neither, at the finest resolution or within the budget.

Cells of orientation are refined where the two approximations disagree about one candidate escape.
"""

import itertools
import time
from collections import deque
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import shapely

from expert.caging.problem import Arrangement
from expert.geometry.pose import Array
from expert.verify.cspace_cells import COARSEST, START, TURN, Cell, CellComplex, Components
from expert.verify.escape import escape_fault
from expert.verify.escape_path import Leg, escape_path

Node = tuple[Cell, int]
Verdict = Literal["caged", "escapes", "unknown"]
UNIT = 2 * np.pi / TURN


@dataclass(frozen=True, kw_only=True)
class CageReport:
    """What was shown.

    rotation_range: orientations [rad] that the object can reach at most (caged); (-inf, inf) where it may turn for good.
    path: body poses (K, 3) of an escape; neighbours differ by a translation or by a rotation about a fixed point.
    resolution: half-width [rad] of the smallest cell.  cells: how many were computed.
    """

    verdict: Verdict
    cells: int
    resolution: float
    seconds: float
    rotation_range: tuple[float, float] | None = None
    path: Array = field(default_factory=lambda: np.empty((0, 3)))

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON values; an unlimited rotation_range is null."""
        limited = self.rotation_range is not None and np.isfinite(self.rotation_range).all()
        return {
            "verdict": self.verdict,
            "rotation_range": list(self.rotation_range) if self.rotation_range and limited else None,
            "turns_freely": self.rotation_range is not None and not limited,
            "cells": self.cells,
            "resolution": self.resolution,
            "seconds": self.seconds,
            "path": self.path.tolist(),
        }

    def __str__(self) -> str:
        cells = f"{self.cells} cells, half-width down to {np.degrees(self.resolution):.3g} deg"
        if self.verdict == "escapes":
            return f"escapes: a collision-free path of {len(self.path)} poses, checked exactly ({cells})"
        if self.verdict == "unknown":
            return f"unknown: inner and outer approximations still disagree ({cells})"
        assert self.rotation_range is not None
        low, high = np.degrees(self.rotation_range)
        turn = f"orientations within [{low:.4g}, {high:.4g}] deg" if np.isfinite(low) else "any orientation"
        return f"caged: {turn} ({cells})"


def verify_cage(
    arrangement: Arrangement,
    *,
    slack: float = 0.0,
    range_resolution: float = np.radians(0.5),
    finest: float = np.radians(1 / 32),
    cell_budget: int = 3000,
) -> CageReport:
    """Decide whether the object can leave its obstacles.

    slack: length [m] by which every finger may be elsewhere and a cage still be a cage; escapes are those of the fingers
    as given.  range_resolution: width [rad] to which the ends of a cage's rotation range are located.  finest: smallest
    half-width [rad] of a cell (1/32 degree at least).  cell_budget: cells after which the answer is UNKNOWN.
    """
    began = time.perf_counter()
    search = _Search(arrangement, slack)
    verdict, path = search.run(2 * finest, range_resolution, cell_budget)
    return CageReport(
        verdict=verdict,
        cells=search.complex.evaluated,
        resolution=np.pi / TURN * min(cell.width for cell in search.ahead if cell.width),
        seconds=time.perf_counter() - began,
        rotation_range=search.rotation_range() if verdict == "caged" else None,
        path=path,
    )


class _Search:
    """Cells in cyclic order (`ahead`, `behind`) and floods through their inner and outer components."""

    def __init__(self, arrangement: Arrangement, slack: float) -> None:
        self.arrangement = arrangement
        self.complex = CellComplex(arrangement, slack)
        ring = [START, *(Cell(s, COARSEST) for s in range(0, TURN, COARSEST)), START]
        self.ahead = dict(itertools.pairwise(ring))
        self.behind = {b: a for a, b in self.ahead.items()}
        self.reached: set[Cell] = set()
        self.exhausted: set[Cell] = set()
        self._links: dict[tuple, np.ndarray] = {}

    def run(self, finest: float, range_resolution: float, cell_budget: int) -> tuple[Verdict, Array]:
        """Refine until a flood of the inner components stays bounded or one of the outer components escapes."""
        nowhere = np.empty((0, 3))
        while self.complex.evaluated < cell_budget:
            route = self.candidate_escape()
            if route is None and self.exhausted:
                self.exhausted.clear()  # was the doubt about them decisive?
                if self.candidate_escape() is not None:
                    return "unknown", nowhere
            if route is None:
                blunt = self.blunt_ends(range_resolution)
                if not blunt:
                    return "caged", nowhere
                self.split(blunt)
                continue
            for cell, _ in route:
                self.complex.outer(cell)
            inside = self.outer_flood(self.outer_starts())
            if (path := self.checked_path(inside)) is not None:
                return "escapes", path
            if not self.refine(self.doubtful_cells(route, inside), finest):
                return "unknown", nowhere
        return "unknown", nowhere

    def refine(self, doubtful: list[Cell], finest: float) -> bool:
        """Halve doubtful cells; those at the finest width count as exhausted.  False where nothing is left to do."""
        divisible = {c for c in doubtful if c.width > 1 and c.width * UNIT > 1.000001 * finest}
        self.split(divisible)
        spent = set(doubtful) - divisible - self.exhausted
        if not divisible:
            self.exhausted |= spent
        return bool(divisible or spent)

    def split(self, cells: set[Cell]) -> None:
        """Halve cells."""
        for cell in cells:
            half = cell.width // 2
            low, high = Cell(cell.start, half), Cell(cell.start + half, half)
            before, after = self.behind.pop(cell), self.ahead.pop(cell)
            for a, b in ((before, low), (low, high), (high, after)):
                self.ahead[a], self.behind[b] = b, a

    def parts(self, cell: Cell) -> Components:
        """Inner components, but where a cell is exhausted, outer ones: other ways out are sought past it."""
        return self.complex.outer(cell) if cell in self.exhausted else self.complex.inner(cell)

    def candidate_escape(self) -> list[Node] | None:
        """Components from the start to infinity, neighbours in touch; None: there is no way."""
        at_start = shapely.intersects(self.parts(START).polygons, shapely.Point(0, 0))
        queue = deque((START, int(k)) for k in np.flatnonzero(at_start))
        came_from: dict[Node, Node | None] = dict.fromkeys(queue)
        self.reached = {START}
        while queue:
            cell, k = queue.popleft()
            self.reached.add(cell)
            if self.parts(cell).unbounded[k]:
                return _trace(came_from, (cell, k))
            for neighbour in {self.ahead[cell], self.behind[cell]}:
                for j in np.flatnonzero(self.links(cell, neighbour)[k]):
                    following = (neighbour, int(j))
                    if following not in came_from:
                        came_from[following] = (cell, k)
                        queue.append(following)
        return None

    def links(self, a: Cell, b: Cell) -> np.ndarray:
        """(components of a, of b): whether they touch at the orientation between the cells."""
        key = ((a, a in self.exhausted), (b, b in self.exhausted))
        if key not in self._links:
            met = shapely.intersects(self.parts(a).polygons[:, None], self.parts(b).polygons[None])
            self._links[key], self._links[key[::-1]] = met, met.T
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
                for i, j in self.complex.passages(cell, neighbour):
                    following = (neighbour, j)
                    if i == k and following not in came_from:
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
        return path if escape_fault(self.arrangement, path) is None else None

    def _passage(self, cell: Cell, k: int, following: Node | None) -> shapely.Geometry | None:
        return self.complex.passages(cell, following[0])[k, following[1]] if following else None

    def doubtful_cells(self, route: list[Node], inside: dict[Node, Node | None]) -> list[Cell]:
        """Cells of a route between the last place shown reachable and the first one shown to lead to infinity."""
        cells = [cell for cell in self.ahead if self.complex.has_outer(cell)]
        exits = [(c, int(k)) for c in cells for k in np.flatnonzero(self.complex.outer(c).unbounded)]
        outside = self.outer_flood(exits)
        came = [k for k, node in enumerate(route) if self._confirmed(node, inside)]
        goes = [k for k, node in enumerate(route) if self._confirmed(node, outside)]
        last, first = max(came, default=0), min(goes, default=len(route) - 1)
        return [cell for cell, _ in route[min(last, first) : max(last, first) + 1]]

    def _confirmed(self, node: Node, flood: dict[Node, Node | None]) -> bool:
        """Whether a flooded outer component lies in this component."""
        cell, k = node
        if cell in self.exhausted:
            return node in flood
        within = shapely.intersects(self.complex.inner(cell).polygons[k], self.complex.outer(cell).polygons)
        return any((cell, int(j)) in flood for j in np.flatnonzero(within))

    def blunt_ends(self, resolution: float) -> set[Cell]:
        """First and last reached cells where they are wider than the resolution."""
        if len(self.reached) == len(self.ahead):
            return set()
        ends = {self._last(self.ahead), self._last(self.behind)}
        return {c for c in ends if c.width * UNIT > resolution and c.width > 1}

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
