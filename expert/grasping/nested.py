"""Nested cages along finger paths as one mixed-integer model (Thesis 5.2, mended).  Relative lengths.

p[k, n]     finger n at knot k                       z[g]        the final grasp: facets of all fingers, rays that hold it
H[n, (i,j)] exit piece i of n meets entry piece j of n + 1: one topology for all knots
W[n, f, (i,j)]  transport: 1 iff finger n ends on facet f, with entry piece i and exit piece j
turns[n]    full turns between exit of n and entry of n + 1
y           points that fill the loop at each knot where it must be shut
alpha[h]    the start knot keeps q + alpha_h r_h free

Each block cites the equation that it restates or mends.  What is not stated here, and decided by the independent checker:
that no start gets stuck on the way (docs/errata.md, Remark 1).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from expert.caging.model import join_pieces, triangles, wind_once
from expert.geometry.convex import Region
from expert.geometry.cover import clip, half_planes
from expert.geometry.polygon import signed_area
from expert.geometry.pose import Array
from expert.grasping.cell import LEAST_MOMENT
from expert.grasping.facets import Facets, rays
from expert.grasping.goal_cell import DIRECTIONS, MIN_WEIGHT, REACH, SUM_WEIGHT
from expert.grasping.rows import Rows
from expert.grasping.smooth import SPEED
from expert.loops.swept import SweptGeometry, cleaned, swept_inside
from expert.mip.linear import LinearModel, Term
from expert.world.values import IntArray

HalfPlanes = tuple[Array, Array]
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

    def common_swept(self, low: float, high: float, clearance: float) -> dict[tuple[int, int], HalfPlanes]:
        """Points that are in pieces i and j at all angles in [low, high], as {x : A x <= b}; none: 0 <= -1."""
        sets = {}
        for i, j in zip(*np.nonzero(self.meeting), strict=True):
            polygon = clip(self.pieces[j], *half_planes(self.pieces[i]))
            swept = swept_inside(cleaned(polygon), low, high, clearance)
            solid = len(swept) >= 3 and signed_area(swept) > 1e-9
            sets[int(i), int(j)] = (
                half_planes(cleaned(swept)) if solid else (np.zeros((1, 2)), np.array([-1.0]))
            )
        return sets


@dataclass(frozen=True)
class Grasp:
    """Facets of the fingers in the order of the loop, and the rays whose moments hold the object from above and below.

    jaws: what grippers ask of the fingers at every knot.
    """

    facets: tuple[int, ...]
    up: int
    down: int
    jaws: Rows | None = None


@dataclass(frozen=True)
class Knot:
    """Half-ranges [rad] of the object at a knot: on arrival and on departure; the clearance; whether it is the last."""

    reach: float
    limit: float
    clearance: float
    last: bool = False

    def shut(self) -> list[tuple[float, float]]:
        """Ranges of |angle| in which no free space may be left: from limit to reach, the narrower the nearer to the goal."""
        ranges, low = [], self.limit
        while low < self.reach - 1e-9:
            high = min(low + min(WIDEST, low), self.reach)
            ranges.append((low, high))
            low = high
        return ranges or [(self.limit, self.limit)]


def schedule(half_ranges: Array, margin: float) -> list[Knot]:
    """Knots of a path: at knot k the object arrives within half_ranges[k - 1] and leaves within half_ranges[k]."""
    reaches = np.concatenate([half_ranges[:1], half_ranges[:-1]])
    return [
        Knot(
            reach, limit, margin * min(1.0, np.sin(limit) / np.sin(np.radians(3))), k == len(half_ranges) - 1
        )
        for k, (reach, limit) in enumerate(zip(reaches, half_ranges, strict=True))
    ]


class NestedCages:
    """The model for given knots and a choice of final grasps; hubs: how the loop is filled below and above the goal."""

    def __init__(
        self,
        geometry: FacetGeometry,
        grasps: Sequence[Grasp],
        knots: Sequence[Knot],
        *,
        hubs: tuple[int, int] = (0, 0),
        one_piece: bool = False,
    ) -> None:
        self.geometry, self.grasps, self.knots, self.hubs = geometry, tuple(grasps), tuple(knots), hubs
        self.table = geometry.table
        self.count = len(grasps[0].facets)
        only = np.eye(len(geometry.pieces), dtype=bool) if one_piece else True
        self.pairs = [(int(i), int(j)) for i, j in zip(*np.nonzero(geometry.meeting & only), strict=True)]
        self.facets = sorted({f for grasp in grasps for f in grasp.facets})
        self.overlaps = [geometry.overlaps(-knot.reach, knot.reach) for knot in knots]
        self.keys = [key for key in self.overlaps[0] if all(key in sets for sets in self.overlaps)]
        self.feasible = bool(self.keys) and bool(self.pairs)
        self.milp = LinearModel()
        if self.feasible:
            self.p = self.milp.add((len(knots), self.count, 2), -REACH, REACH)
            self._final_grasp()
            self._non_penetration()
            self._loops()
            self._winding()
            self._limits()
            self._observability()
            self._region_of_attraction()
            self._grippers()

    def _final_grasp(self) -> None:
        """T in L_O (5-CT14): one grasp; the facet that a finger ends on decides its region and its pieces."""
        m, n, facets = self.milp, self.count, len(self.facets)
        self.z = m.binaries(len(self.grasps))
        m.equal([(1.0, self.z)], 1.0)
        self.T = m.add((n, facets), 0.0, 1.0)
        ends_on = np.array([[[g.facets[c] == f for g in self.grasps] for f in self.facets] for c in range(n)])
        m.equal(
            [(ends_on.astype(float), np.broadcast_to(self.z, ends_on.shape)), (-1.0, self.T)],
            np.zeros((n, facets)),
        )
        self.W = m.add((n, facets, len(self.pairs)), 0.0, 1.0)
        m.equal([(1.0, self.W), (-1.0, self.T[..., None])], np.zeros((n, facets)))

    def _non_penetration(self) -> None:
        """5-CT6 along the whole path: fingers stay in the convex region over their final facet, and end on it."""
        m, n, table = self.milp, self.count, self.table
        self.s = []
        for k, knot in enumerate(self.knots):
            s = self._copies(self.p[k], self.T)
            self.s.append(s)
            for t, f in enumerate(self.facets):
                region = table.beyond(f)
                b = region.b - (0.0 if knot.last else knot.clearance)
                for a, bound in zip(region.A, b, strict=True):
                    m.at_most([(a, s[:, t]), (-bound, self.T[:, t, None])], np.zeros(n))
                if knot.last:
                    along, inset = table.tangents[f], self.geometry.clearance
                    m.equal(
                        [(table.normals[f], s[:, t]), (-table.offsets[f], self.T[:, t, None])], np.zeros(n)
                    )
                    m.at_most([(along, s[:, t]), (inset - table.high[f], self.T[:, t, None])], np.zeros(n))
                    m.at_most([(-along, s[:, t]), (inset + table.low[f], self.T[:, t, None])], np.zeros(n))

    def _copies(self, whole: IntArray, shares: IntArray, bound: float = REACH) -> IntArray:
        """Variables (..., m, 2), one share of whole (..., 2) for each of shares (..., m), zero where that is zero."""
        m = self.milp
        parts = m.add((*shares.shape, 2), -bound, bound)
        m.equal([(1.0, whole), (-1.0, np.swapaxes(parts, -1, -2))], np.zeros(whole.shape))
        for sign in (1.0, -1.0):
            m.at_most(
                [(sign, parts), (-bound, np.broadcast_to(shares[..., None], parts.shape))],
                np.zeros(parts.shape),
            )
        return parts

    def _loops(self) -> None:
        """5-CT12, 13 for all orientations of a knot at once: H = 1 => p[n] - p[n+1] in K_ij, the same H at every knot."""
        m, n = self.milp, self.count
        self.H = m.binaries(n, len(self.keys))
        m.equal([(1.0, self.H)], np.ones(n))
        for k in range(len(self.knots)):
            step = m.add((n, 2), -2 * REACH, 2 * REACH)
            m.equal(
                [(1.0, self.p[k]), (-1.0, np.roll(self.p[k], -1, axis=0)), (-1.0, step)], np.zeros((n, 2))
            )
            d = self._copies(step, self.H, 2 * REACH)
            for q, key in enumerate(self.keys):
                for a, b in zip(*self.overlaps[k][key], strict=True):
                    m.at_most([(a, d[:, q]), (-b, self.H[:, q, None])], np.zeros(n))
        join_pieces(m, len(self.geometry.pieces), self.H, self.keys, self.W, self.pairs)

    def _winding(self) -> None:
        """Configuration enclosing (5-CT5): the loop winds once around the goal."""
        n, alpha = self.count, self.geometry.directions[self.facets]
        entry, exit_ = (np.array([pair[e] for pair in self.pairs]) for e in (0, 1))
        into, out = (np.broadcast_to(alpha[:, e], self.W.shape).reshape(n, -1) for e in (entry, exit_))
        wind_once(self.milp, self.W.reshape(n, -1), into, out)

    def _limits(self) -> None:
        """Limit orientations (5-CT7, 8, 12, 15): a filled loop at all angles from which the object is shut out."""
        for k, knot in enumerate(self.knots):
            for low, high in knot.shut():
                self._fill(k, -high, -low, self.hubs[0])
                self._fill(k, low, high, self.hubs[1])

    def _fill(self, k: int, low: float, high: float, hub: int) -> None:
        """Each triangle of the loop has a point y in the obstacles of its corners at every angle in [low, high]."""
        m = self.milp
        chosen = self.geometry.common_swept(low, high, self.knots[k].clearance)
        for triangle in triangles(self.count, hub):
            y = m.add((2,), -2 * REACH, 2 * REACH)
            for c, _ in triangle:
                shares = m.add((len(self.pairs),), 0.0, 1.0)
                m.equal([(1.0, self.W[c].T), (-1.0, shares[:, None])], np.zeros(len(self.pairs)))
                offset = m.add((2,), -2 * REACH, 2 * REACH)
                m.equal([(1.0, self.p[k, c]), (-1.0, y), (-1.0, offset)], np.zeros(2))
                f = self._copies(offset, shares, 2 * REACH)
                for q, pair in enumerate(self.pairs):
                    A, b = chosen[pair]
                    m.at_most(
                        [(A, np.broadcast_to(f[q], A.shape)), (-b, np.full(len(b), shares[q]))],
                        np.zeros(len(b)),
                    )

    def _observability(self) -> None:
        """First-order form closure, which 5-CT17..19 fall short of: z = 1 => moments of both senses at the last knot."""
        m, table = self.milp, self.table
        last = self.p[-1]
        for z, grasp in zip(self.z, self.grasps, strict=True):
            index = list(grasp.facets)
            weights = rays(table.normals[index])
            if grasp.up == grasp.down:
                self._concurrent(z, weights[grasp.up][:, None] * table.tangents[index])
                continue
            for ray, sign in ((grasp.up, 1.0), (grasp.down, -1.0)):
                moment = sign * weights[ray][:, None] * table.tangents[index]
                most = float(np.abs(moment).sum() * REACH)
                m.at_most([(moment.ravel(), last.ravel()), (most + LEAST_MOMENT, np.array([z]))], most)

    def _concurrent(self, z: np.int64, moment: Array) -> None:
        """Three fingers hold by curvature where their normals meet: z = 1 => no moment."""
        most = float(np.abs(moment).sum() * REACH)
        for sign in (1.0, -1.0):
            self.milp.at_most([(sign * moment.ravel(), self.p[-1].ravel()), (most, np.array([z]))], most)

    def _region_of_attraction(self) -> None:
        """5-CT16: q + alpha_h r_h is free while each finger keeps to its region, which joins it with q."""
        m, h = self.milp, len(DIRECTIONS)
        self.alpha = m.add((h,), 0.0, REACH)
        share = m.add((h, self.count, len(self.facets)), 0.0, REACH)
        m.equal(
            [(1.0, share), (-1.0, np.broadcast_to(self.alpha[:, None, None], (h, self.count, 1)))],
            np.zeros((h, self.count)),
        )
        m.at_most([(1.0, share), (-REACH, np.broadcast_to(self.T, share.shape))], np.zeros(share.shape))
        for t, f in enumerate(self.facets):
            region = self.table.beyond(f)
            for a, b in zip(region.A, region.b, strict=True):
                for k, r in enumerate(DIRECTIONS):
                    terms = [(a, self.s[0][:, t]), (-(a @ r), share[k, :, t]), (-b, self.T[:, t])]
                    m.at_most(terms, np.zeros(self.count))

    def _grippers(self) -> None:
        """Kinematics of parallel jaws (Thesis 5.2.5), with the one grasp that they were stated for."""
        for jaws in (grasp.jaws for grasp in self.grasps if grasp.jaws is not None):
            for p in self.p:
                fingers = np.broadcast_to(p.ravel(), (len(jaws.V), p.size))
                V, high, low = jaws.V.reshape(-1, p.size), np.isfinite(jaws.high), np.isfinite(jaws.low)
                self.milp.at_most([(V[high], fingers[high])], jaws.high[high])
                self.milp.at_most([(-V[low], fingers[low])], -jaws.low[low])

    def maximise_attraction(self) -> None:
        """Add the objective of 5-CT16's region."""
        self.milp.minimise([(-SUM_WEIGHT, self.alpha), (-MIN_WEIGHT, self.common_alpha())])

    def common_alpha(self) -> IntArray:
        """The one alpha of MIQP2, (1,): no larger than any alpha_h."""
        alpha = self.milp.add((1,), 0.0, REACH)
        among = np.repeat(alpha, len(self.alpha))
        self.milp.at_most([(1.0, among), (-1.0, self.alpha)], np.zeros(len(self.alpha)))
        return alpha

    def minimise_acceleration(self) -> None:
        """Add the cost of MIQP1: squared second differences of all fingers, and a little of their length."""
        m, p = self.milp, self.p
        bend = m.add(p[2:].shape, -4 * REACH, 4 * REACH)
        m.equal([(1.0, bend), (-1.0, p[2:]), (2.0, p[1:-1]), (-1.0, p[:-2])], np.zeros(bend.shape))
        zero = np.broadcast_to(m.add((1,), 0.0, 0.0), bend.shape)
        m.minimise([], [(1.0, bend, zero), (SPEED, p[1:], p[:-1])])

    def minimise_bends(self, weight: float) -> None:
        """The same in the sum norm, for a linear solver: it has the same paths without any acceleration."""
        m, p = self.milp, self.p
        bend = m.add(p[2:].shape, 0.0, 4 * REACH)
        for sign in (1.0, -1.0):
            terms: list[Term] = [(sign, p[2:]), (-2 * sign, p[1:-1]), (sign, p[:-2]), (-1.0, bend)]
            m.at_most(terms, np.zeros(bend.shape))
        m.minimise([(weight, bend)])

    def cut(self, x: Array) -> None:
        """Never again this grasp with this topology."""
        on = np.concatenate([v.ravel()[x[v.ravel()] > 0.5] for v in (self.z, self.H)])
        self.milp.at_most([(1.0, on)], len(on) - 1.0)

    def fix(self, meetings: Sequence[tuple[int, int]], pairs: Sequence[tuple[int, int]]) -> None:
        """Fix how the loop passes through each finger and on to the next: what remains is convex."""
        m = self.milp
        for n, (key, pair) in enumerate(zip(meetings, pairs, strict=True)):
            m.equal([(1.0, self.H[n, [self.keys.index(key)]])], 1.0)
            m.equal([(1.0, self.W[n, :, self.pairs.index(pair)])], 1.0)
