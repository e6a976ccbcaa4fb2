"""The goal cell: one facet per finger, whose lines bound the free space about the goal at every orientation.

At orientation t finger n keeps the object's reference x in the half-plane  (R n) . x <= (R n) . p_n - d, n and d of its
facet.  While the finger touches within the facet wherever that line bounds the cell, the cell is a whole component of
free space; convex in each slice and, where its slices exist for an interval of t, connected with the goal: no dead end.

f_k(t) = sum_n lambda_n ((R n) . p_n - d_n) >= 0 for all extreme rays lambda_k says that the slice at t exists.
All conditions are linear in p.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from expert.geometry.pose import Array, cross
from expert.grasping.facets import Facets
from expert.grasping.rows import Rows
from expert.loops.normals import rays

LEAST_MOMENT = 0.05
"""Moment (relative length) that each of the two rays must have at the end, in opposite senses."""
OVERLAP = 2.0
"""Where two fingers bound the cell next to each other their obstacles overlap by so many margins."""
LEAST_SINE = 0.1
"""Facets at a smaller angle count as if they had this one."""
NARROW = np.radians(3)
"""Half-range below which clearances shrink with it."""
CURVATURE_SHARE = 0.2
"""Share of the clearance that three fingers' curvature leaves which each condition keeps."""


@dataclass(frozen=True)
class GoalCell:
    """Facets of the fingers, sorted by normal angle, and which rays end the cell above (up) and below (down) the goal.

    Three fingers have one ray, and hold the object by its curvature where their normals meet in a point.
    jaws: what grippers ask of the fingers at every knot.  least: moment that the rays must have at the end.
    """

    table: Facets
    chosen: tuple[int, ...]
    up: int
    down: int
    margin: float
    jaws: Rows | None = None
    least: float = LEAST_MOMENT

    @property
    def count(self) -> int:
        """Number of fingers."""
        return len(self.chosen)

    @cached_property
    def normals(self) -> Array:
        """Facet normals (N, 2)."""
        return self.table.normals[list(self.chosen)]

    @cached_property
    def offsets(self) -> Array:
        """Facet offsets (N,)."""
        return self.table.offsets[list(self.chosen)]

    @cached_property
    def rays(self) -> Array:
        """Extreme rays (k, N)."""
        return rays(self.normals)

    @cached_property
    def E(self) -> Array:
        """sum lambda d of each ray (k,)."""
        return self.rays @ self.offsets

    def clearance(self) -> Rows:
        """Goal clearance: n . p_n >= d, as rows that turn with the object."""
        return Rows(np.eye(self.count)[:, :, None] * self.normals, self.offsets, np.full(self.count, np.inf))

    def ray_rows(self, k: int, low: float, high: float) -> Rows:
        """low <= f_k <= high."""
        V = (self.rays[k][:, None] * self.normals)[None]
        return Rows(V, np.array([low + self.E[k]]), np.array([high + self.E[k]]))

    @cached_property
    def contacts(self) -> Rows:
        """Where the lines of neighbours meet, both touch within their facets, and all fingers stay in their wedges."""
        pairs = self.table.neighbours(self.chosen)
        corners = [self._corner(i, j) for i, j in pairs]
        rows = []
        for (i, j), (V, c) in zip(pairs, corners, strict=True):
            inset = self._inset(i, j)
            rows.append(self._on_facet(i, V, c, inset))
            rows.append(self._on_facet(j, *self._seen_from(j, i, V, c), inset))
            rows += [self._in_wedge(n, *self._seen_from(n, i, V, c)) for n in range(self.count)]
        return Rows.join(rows)

    def _corner(self, i: int, j: int) -> tuple[Array, Array]:
        """Contact of finger i, in the body frame, where lines i and j meet: y = c + sum_n A_n R' p_n with A (2, N, 2)."""
        u, w = np.linalg.inv(self.normals[[i, j]]).T
        constant = u * self.offsets[i] + w * self.offsets[j]
        A = np.zeros((2, self.count, 2))
        A[:, j] = -np.outer(w, self.normals[j])
        A[:, i] = np.outer(w, self.normals[j])
        return A, constant

    def _seen_from(self, n: int, i: int, A: Array, constant: Array) -> tuple[Array, Array]:
        """Where finger n is in the body frame when finger i is at the given point of it: y + R' (p_n - p_i)."""
        moved = A.copy()
        moved[:, n] += np.eye(2)
        moved[:, i] -= np.eye(2)
        return moved, constant

    def _inset(self, i: int, j: int) -> float:
        """Distance from the facets' ends at which obstacles that cross at the angle of these facets overlap by the margin."""
        return OVERLAP * self.margin / max(abs(float(cross(self.normals[i], self.normals[j]))), LEAST_SINE)

    def _on_facet(self, n: int, A: Array, constant: Array, inset: float) -> Rows:
        facet = self.chosen[n]
        along = self.table.tangents[facet]
        V = np.einsum("d,dnx->nx", along, A)[None]
        shift = along @ constant
        low, high = self.table.low[facet] + inset, self.table.high[facet] - inset
        return Rows(V, np.array([low - shift]), np.array([high - shift]))

    def _in_wedge(self, n: int, A: Array, constant: Array) -> Rows:
        wedge = self.table.wedge(self.chosen[n])
        if wedge is None:
            return Rows(np.empty((0, self.count, 2)), np.empty(0), np.empty(0))
        V = np.einsum("wd,dnx->wnx", wedge.A, A)
        high = wedge.b - self.margin - wedge.A @ constant
        return Rows(V, np.full(len(high), -np.inf), high)

    @property
    def concurrent(self) -> bool:
        """Whether one ray shuts the cell both above and below the goal."""
        return self.up == self.down

    def slack(self, limit: float) -> float:
        """Clearance that is left at a knot with this half-range: the nearer to the end the less."""
        if self.concurrent:
            return min(self.margin, CURVATURE_SHARE * float(self.E[self.up]) * (1 - np.cos(limit)))
        return self.margin * min(1.0, np.sin(limit) / np.sin(NARROW))

    def knot(self, reach: float, limit: float) -> Rows:
        """Conditions at a knot before the last: on arrival the object is within +-reach, on departure within +-limit."""
        eps = self.slack(limit)
        parts = [self.contacts.over(-reach, reach), _raised(self.clearance().at(0.0), eps)]
        for k, side in ((self.up, 1.0), (self.down, -1.0)):
            below = self.ray_rows(k, -np.inf, -eps)
            falling = Rows(side * below.V, np.array([-np.inf]), np.array([0.0]))
            parts += [below.at(side * limit), below.at(side * reach), falling.slope(side * limit)]
        return Rows.join([*parts, self.jaws] if self.jaws is not None else parts)

    def held(self, moment: float | None = None) -> list[Rows]:
        """All fingers touch at the goal, as the grippers allow, and the rays' moments hold it (form closure)."""
        touch, level = self.clearance().at(0.0), self.moments()
        least = np.zeros(1) if self.concurrent else np.full(2, self.least if moment is None else moment)
        most = np.zeros(1) if self.concurrent else np.full(2, np.inf)
        hold = Rows(level.V[: len(least)], least, most)
        return [Rows(touch.V, touch.low, touch.low), hold, *([self.jaws] if self.jaws is not None else [])]

    def end(self, reach: float, moment: float | None = None) -> Rows:
        """Conditions at the last knot: the grasp holds, and the object is shut out on arrival at +-reach."""
        parts = [self.contacts.over(-reach, reach), *self.held(moment)]
        if not self.concurrent:
            eps = self.slack(reach)
            for k, side in ((self.up, 1.0), (self.down, -1.0)):
                parts.append(self.ray_rows(k, -np.inf, -eps).at(side * reach))
        return Rows.join(parts)

    def moments(self) -> Rows:
        """f'(0) >= 0 of the ray that shuts the cell below, -f'(0) >= 0 of the one above."""
        V = np.stack([-self.ray_rows(self.up, 0, 0).V[0], self.ray_rows(self.down, 0, 0).V[0]])
        return Rows(V, np.zeros(2), np.full(2, np.inf)).slope(0.0)

    def slice(self, p: Array, angle: float = 0.0) -> tuple[Array, Array]:
        """The cell at an orientation, {x : A x <= b}, for fingers p (N, 2)."""
        c, s = np.cos(angle), np.sin(angle)
        A = self.normals @ np.array([[c, s], [-s, c]])
        return A, (A * p).sum(axis=1) - self.offsets


def _raised(rows: Rows, by: float) -> Rows:
    return Rows(rows.V, rows.low + by, rows.high)
