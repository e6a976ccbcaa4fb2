"""The set of starts: configurations proven to be connected with the goal while the fingers are at their first knot."""

from collections import deque
from typing import Any

import numpy as np
import shapely

from expert.budget import UNLIMITED, Budget
from expert.geometry.pose import Array
from expert.verify.cage.cells import DEGREE, START, TURN, Cell, CellComplex
from expert.verify.grasp.finger_path import FingerPath
from expert.verify.grasp.slab import signed_bounds
from expert.world.values import require

WIDTH = DEGREE // 2
"""Of a cell."""
SEAM = 1e-6
"""Relative length by which a polygon of starts may touch what is not free."""


class StartSet:
    """Free prisms (polygon of positions times cell of orientations) that hang together with the goal, from inside."""

    def __init__(self, path: FingerPath, budget: Budget = UNLIMITED, *, width: int = WIDTH) -> None:
        self.path, self.width = path, width
        self._cells = CellComplex(path.arrangement(0.0), on_grid=True, budget=budget)
        self._prisms = self._flood()

    def _flood(self) -> dict[Cell, list[int]]:
        slice_ = self._cells.outer(START).polygons
        near = shapely.distance(slice_, shapely.Point(0, 0)) <= 1e-6
        queue = deque((START, int(k)) for k in np.flatnonzero(near))
        seen = set(queue)
        while queue:
            cell, k = queue.popleft()
            if self._cells.outer(cell).unbounded[k]:
                return {}
            for other in self._neighbours(cell):
                for j in self._cells.passages(cell, other)[k]:
                    if (other, j) not in seen:
                        seen.add((other, j))
                        queue.append((other, j))
        prisms: dict[Cell, list[int]] = {}
        for cell, k in sorted(seen):  # so that a seed draws the same starts, however cells are numbered
            prisms.setdefault(cell, []).append(k)
        return prisms

    def _neighbours(self, cell: Cell) -> list[Cell]:
        low, high = Cell(-self.width % TURN, self.width), Cell(0, self.width)
        if cell == START:
            return [low, high]
        starts = ((cell.start - self.width) % TURN, (cell.start + self.width) % TURN)
        beside = [Cell(start, self.width) for start in starts]
        return [*beside, START] if cell in (low, high) else beside

    @property
    def bounded(self) -> bool:
        """Whether the goal is caged at all."""
        return bool(self._prisms)

    @property
    def area(self) -> float:
        """Area [m^2] of the starts at the goal's orientation."""
        polygons = self._cells.outer(START).polygons
        held = sum(polygons[k].area for k in self._prisms.get(START, []))
        return float(held * self.path.frame.radius**2)

    @property
    def range(self) -> tuple[float, float]:
        """Orientations [rad] relative to the goal."""
        bounds = [signed_bounds(cell) for cell in self._prisms] or [(0.0, 0.0)]
        return min(b[0] for b in bounds), max(b[1] for b in bounds)

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {"area": self.area, "range": list(self.range)}

    def __str__(self) -> str:
        low, high = np.degrees(self.range)
        return f"start      Q0 has {self.area:.3g} m^2 at the goal's orientation and reaches [{low:.4g}, {high:.4g}] deg"

    def starts(self, rng: np.random.Generator, count: int) -> Array:
        """World poses (count, 3), uniform over the prisms (in position and orientation).

        Raises InvalidProblem where the goal is not caged.
        """
        require(self.bounded, "fingers.path", "fingers that cage the goal at the first knot", "an open cage")
        prisms = [
            (cell, self._cells.outer(cell).polygons[k]) for cell, ks in self._prisms.items() for k in ks
        ]
        prisms = [(cell, polygon) for cell, polygon in prisms if cell.width]
        volumes = np.array([polygon.area * cell.width for cell, polygon in prisms])
        chosen = rng.choice(len(prisms), count, p=volumes / volumes.sum())
        found = np.empty((count, 3))
        for m in np.unique(chosen):
            cell, polygon = prisms[m]
            rows = np.flatnonzero(chosen == m)
            found[rows, :2] = _points_in(polygon, rng, len(rows))
            found[rows, 2] = rng.uniform(*signed_bounds(cell), len(rows))
        return self.path.frame.world_pose(found)

    def holds(self, translations: Array) -> tuple[bool, bool]:
        """Whether a polygon (M, 2) [m, world] of translations from the goal, at its orientation, is free, and proven to be held.

        Up to SEAM: on its boundary fingers touch.
        """
        relative = shapely.Polygon(self.path.frame.relative(translations + self.path.frame.reference_w))
        if not relative.is_valid:
            return False, False
        slice_, inside = self._cells.outer(START).polygons, relative.buffer(-SEAM)
        blocked = shapely.difference(shapely.intersection(inside, self._cells.box), shapely.union_all(slice_))
        elsewhere = shapely.difference(inside, shapely.union_all(slice_[self._prisms.get(START, [])]))
        return bool(blocked.is_empty), bool(elsewhere.is_empty)

    def contains(self, poses: Array) -> np.ndarray:
        """Which world poses (M, 3) are proven members."""
        return np.array([self._holds(c) for c in self.path.configurations(poses)], dtype=bool)

    def _holds(self, configuration: Array) -> bool:
        point = shapely.Point(configuration[:2])
        for cell, ks in self._prisms.items():
            low, high = signed_bounds(cell)
            if (
                low <= configuration[2] <= high
                and shapely.intersects(self._cells.outer(cell).polygons[ks], point).any()
            ):
                return True
        return False


def _points_in(polygon: shapely.Polygon, rng: np.random.Generator, count: int) -> Array:
    """Uniform points (count, 2) in a polygon: a triangle by its area, then a point in it."""
    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(polygon))
    areas = shapely.area(triangles)
    chosen = rng.choice(len(triangles), count, p=areas / areas.sum())
    corners = shapely.get_coordinates(triangles).reshape(-1, 4, 2)[chosen, :3]
    u = np.sort(rng.random((count, 2)), axis=1)
    weights = np.column_stack([u[:, 0], u[:, 1] - u[:, 0], 1 - u[:, 1]])
    return np.asarray(np.einsum("nk,nkd->nd", weights, corners))
