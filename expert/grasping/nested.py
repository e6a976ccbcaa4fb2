"""Nested cages along finger paths (Thesis 5.2, mended): the loop of `expert.loops.model` at many knots, and how it ends.

p[k, n]     finger n at knot k                       z[g]        the final grasp: facets of all fingers, rays that hold it
R[n, f]     1 iff finger n ends on facet f           alpha[h]    the start knot keeps q + alpha_h r_h free

Each block cites the equation that it restates or mends.  What is not stated here, and decided by the independent checker:
that no start gets stuck on the way (docs/errata.md, Remark 1).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from expert.geometry.convex import Region
from expert.geometry.pose import Array
from expert.grasping.cell import NARROW, GoalCell
from expert.grasping.facets import Facets
from expert.grasping.goal_cell import DIRECTIONS, MIN_WEIGHT, SUM_WEIGHT
from expert.grasping.smooth import SPEED
from expert.loops.model import Element, Knot, LoopModel
from expert.loops.swept import FARTHEST, SweptGeometry
from expert.mip.affine import Affine

WIDEST = np.radians(4)
"""Largest range of angles over which one point fills a triangle of the loop."""


@dataclass(frozen=True)
class FacetGeometry(SweptGeometry):
    """Swept sets whose regions are those over each facet of the object."""

    @cached_property
    def table(self) -> Facets:
        """The object's facets."""
        return Facets.of(self.vertices)

    @cached_property
    def regions(self) -> list[Region]:
        """Beyond facet f and in its wedge, at the goal."""
        return [self.table.beyond(f) for f in range(len(self.table))]


def schedule(half_ranges: Array, margin: float) -> list[Knot]:
    """Knots of a path: at knot k the object arrives within half_ranges[k - 1] and leaves within half_ranges[k] (5-CT15)."""
    knots = []
    for k, limit in enumerate(half_ranges):
        reach = half_ranges[max(k - 1, 0)]
        above = tuple(shut(limit, reach))
        below = tuple((-high, -low) for low, high in above)
        clearance = margin * min(1.0, np.sin(limit) / np.sin(NARROW))
        knots.append(Knot(-reach, reach, below, above, clearance, touching=k == len(half_ranges) - 1))
    return knots


def shut(limit: float, reach: float) -> list[tuple[float, float]]:
    """Ranges of |angle| in which no free space may be left: from limit to reach, the narrower the nearer to the goal."""
    ranges, low = [], limit
    while low < reach - 1e-9:
        high = min(low + min(WIDEST, low), reach)
        ranges.append((low, high))
        low = high
    return ranges or [(limit, limit)]


class NestedCages(LoopModel):
    """The model for given knots and a choice of final grasps; hubs: how the loop is filled below and above the goal."""

    geometry: FacetGeometry

    def __init__(
        self,
        geometry: FacetGeometry,
        grasps: Sequence[GoalCell],
        knots: Sequence[Knot],
        *,
        hubs: tuple[int, int] = (0, 0),
    ) -> None:
        super().__init__(geometry, [Element(finger=n) for n in range(grasps[0].count)], knots, hubs=hubs)
        self.grasps = tuple(grasps)
        self.facets = sorted({f for grasp in grasps for f in grasp.chosen})
        if self.feasible:
            self.close(self._final_grasp(), self.facets)
            self._touch()
            self._observability()
            self._region_of_attraction()
            self._grippers()

    def _final_grasp(self) -> Affine:
        """T in L_O (5-CT14): one grasp; the facet that a finger ends on decides its region and its pieces."""
        m = self.milp
        self.z = m.binaries(len(self.grasps))
        R = m.variables((self.count, len(self.facets)), 0.0, 1.0)
        chosen = np.array([grasp.chosen for grasp in self.grasps])
        ends_on = chosen.T[:, None] == np.array(self.facets)[None, :, None]  # (n, f, g)
        m.add(self.z.sum(axis=0) == 1, (self.z * ends_on).sum(axis=2) == R)
        return R

    def _touch(self) -> None:
        """R = 1 => at the last knot finger n is on facet f, away from its ends."""
        table, inset = self.table, self.geometry.clearance
        for t, f in enumerate(self.facets):
            s, R = self.s[-1][:, t], self.R[:, t]
            self.milp.add(
                s @ table.normals[f] == table.offsets[f] * R,
                s @ table.tangents[f] <= (table.high[f] - inset) * R,
                -(s @ table.tangents[f]) <= -(table.low[f] + inset) * R,
            )

    @property
    def table(self) -> Facets:
        """The object's facets."""
        return self.geometry.table

    def _observability(self) -> None:
        """First-order form closure, which 5-CT17, 5-CT18, 5-CT19 fall short of: z = 1 => moments of both senses at the last knot.

        Three fingers hold by curvature where their normals meet: no moment.
        """
        for z, grasp in zip([self.z[g] for g in range(len(self.grasps))], self.grasps, strict=True):
            tangents = self.table.tangents[list(grasp.chosen)]
            arms = (self.p[-1] * tangents).sum(axis=1)
            least = 0.0 if grasp.concurrent else grasp.least
            for ray, sign in ((grasp.up, 1.0), (grasp.down, -1.0)):
                moment = sign * (grasp.rays[ray] @ arms)
                most = float(np.abs(grasp.rays[ray][:, None] * tangents).sum() * FARTHEST)
                self.milp.add(moment + (most + least) * z <= most)

    def _region_of_attraction(self) -> None:
        """5-CT16: q + alpha_h r_h is free while each finger keeps to its region, which joins it with q."""
        m, h = self.milp, len(DIRECTIONS)
        self.alpha = m.variables((h,), 0.0, FARTHEST)
        share = m.variables((h, self.count, len(self.facets)), 0.0, FARTHEST)
        m.add(share.sum(axis=2) == self.alpha[:, None], share <= FARTHEST * self.R)
        for t, f in enumerate(self.facets):
            region = self.geometry.regions[f]
            speed = region.A @ DIRECTIONS.T  # (row, h)
            m.add(
                (region.A @ self.s[0][:, t].T)[:, None] - speed[:, :, None] * share[:, :, t]
                <= region.b[:, None, None] * self.R[:, t]
            )

    def _grippers(self) -> None:
        """Kinematics of parallel jaws (Thesis 5.2.5), with the one grasp that they were stated for."""
        for jaws in (grasp.jaws for grasp in self.grasps if grasp.jaws is not None):
            for k in range(len(self.knots)):
                fingers = jaws.V.reshape(len(jaws.V), -1) @ self.p[k].reshape(2 * self.count)
                self.milp.between(jaws.low, fingers, jaws.high)

    def maximise_attraction(self) -> None:
        """Add the objective of 5-CT16's region."""
        self.milp.minimise(-SUM_WEIGHT * self.alpha, -MIN_WEIGHT * self.common_alpha())

    def common_alpha(self) -> Affine:
        """The one alpha of MIQP2, (1,): no larger than any alpha_h."""
        alpha = self.milp.variables((1,), 0.0, FARTHEST)
        self.milp.add(alpha <= self.alpha)
        return alpha

    def _bends(self) -> Affine:
        """Second differences of the fingers' paths."""
        return self.p[2:] - 2 * self.p[1:-1] + self.p[:-2]

    def minimise_acceleration(self) -> None:
        """Add the cost of MIQP1: squared second differences of all fingers, and a little of their length."""
        bend = self.milp.variables((len(self.knots) - 2, self.count, 2), -4 * FARTHEST, 4 * FARTHEST)
        self.milp.add(bend == self._bends())
        self.milp.minimise_squares(1.0, bend)
        self.milp.minimise_squares(SPEED, self.p[1:] - self.p[:-1])

    def minimise_bends(self, weight: float) -> None:
        """The same in the sum norm, for a linear solver: it has the same paths without any acceleration."""
        bend = self.milp.variables((len(self.knots) - 2, self.count, 2), 0.0, 4 * FARTHEST)
        self.milp.add(self._bends() <= bend, -self._bends() <= bend)
        self.milp.minimise(weight * bend)

    def cut(self, x: Array) -> None:
        """Never again this grasp with this topology."""
        self.milp.exclude(x, self.z, self.H)

    def fix(self, meetings: Sequence[tuple[int, int]], pairs: Sequence[tuple[int, int]]) -> None:
        """Fix how the loop passes through each finger and on to the next: what remains is convex."""
        for n, (key, pair) in enumerate(zip(meetings, pairs, strict=True)):
            self.milp.add(self.H[n, self.keys.index(key)] == 1)
            self.milp.add(self.W[n, :, self.pairs.index(pair)].sum(axis=0) == 1)
