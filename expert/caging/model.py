"""Swept-Minkowski MIP: fingers whose obstacles form a loop around the start at all orientations of a range [L, U] and a
filled loop at its ends.  All lengths relative (`expert.world.frame`).

p[n]          finger n                                H[n][i, j]   exit piece i of n meets entry piece j of n + 1
R[n, r]       region of finger n at the start         W[n, r, (i, j)] = 1 iff finger n is in region r with entry i, exit j
k[n]          full turns between exit of n and entry of n + 1
y             points that fill the loop at L and at U, one for each triangle of it

Why a solution is a cage: the loop of overlapping pieces exists at every orientation of [L, U] and moves continuously, it
winds once around the start, and at L and U it can be contracted inside the obstacles, so the free component of the start
cannot reach either end, nor cross the loop in between (docs/theory/caging.md).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from expert.geometry.pose import Array, rotation
from expert.loops.swept import REACH, SweptGeometry
from expert.mip.backends import Solver, Status
from expert.mip.linear import LinearModel, Term
from expert.problems.cage import Meeting
from expert.world.values import IntArray

MOST_TURNS = 2
ANGLE_MARGIN = 1e-3
"""[rad]"""


@dataclass(frozen=True)
class Element:
    """One point obstacle of the loop, relative: a searched finger (its index) or a point between `ends` (2, 2).

    A wall is two such points in a row, where the loop enters and where it leaves; `joined` marks the first of them.
    """

    finger: int | None = None
    ends: Array | None = None
    joined: bool = False


@dataclass(frozen=True, kw_only=True)
class Proposal:
    """A model's answer before anyone has verified it: relative fingers (count, 2), None without any, and the loop."""

    status: Status
    fingers: Array | None = None
    meetings: tuple[Meeting, ...] = ()


Pairs = Sequence[tuple[int, int]]


def join_pieces(m: LinearModel, pieces: int, H: IntArray, keys: Pairs, W: IntArray, pairs: Pairs) -> None:
    """The pieces that meet, H (N, keys), are those in which the transport W (N, regions, pairs) enters and leaves.

    keys: exit piece of an element and entry piece of the next; pairs: entry and exit piece of one element.
    """
    n = len(H)
    exit_of, entry_of = (np.array([key[e] for key in keys]) for e in (0, 1))
    entry, exit_ = (np.array([pair[e] for pair in pairs]) for e in (0, 1))
    for c in range(pieces):
        leaves, enters = H[:, exit_of == c], np.roll(H, 1, axis=0)[:, entry_of == c]
        for joins, ends in ((leaves, exit_ == c), (enters, entry == c)):
            m.equal([(1.0, joins), (-1.0, W[:, :, ends].reshape(n, -1))], np.zeros(n))


def wind_once(m: LinearModel, W: IntArray, into: Array, out: Array) -> None:
    """Winding number one about the start: directions of entry and exit (N, choices) go with the transport W (N, choices)."""
    n = len(W)
    turns = m.add((n,), -MOST_TURNS, MOST_TURNS, integral=True)
    for sign in (1.0, -1.0):
        gap: list[Term] = [
            (sign * into, np.roll(W, -1, axis=0)),
            (-sign * out, W),
            (sign * 2 * np.pi, turns[:, None]),
        ]
        m.at_most(gap, np.full(n, np.pi - ANGLE_MARGIN))
    m.equal([(1.0, turns)], 1.0)


Part = Literal["entry", "exit", "both"]


def triangles(count: int, hub: int) -> list[list[tuple[int, Part]]]:
    """Elements and their pieces that share a point where the loop is filled.

    Three and more elements: a fan about element `hub`.  Two: the loop entry 0, exit 0, entry 1, exit 1 is cut along the
    exits (hub 0) or along the entries (hub 1).
    """
    if count == 2:
        part: Part = "entry" if hub else "exit"
        return [[(0, "both"), (1, part)], [(1, "both"), (0, part)]]
    corners = [(hub % count, (hub + t) % count, (hub + t + 1) % count) for t in range(1, count - 1)]
    return [[(c, "both") for c in corner] for corner in corners]


class SweptModel:
    """Variables and constraints for one range of orientations; `hubs` say how the loop is filled at its ends.

    one_piece: the loop enters and leaves each finger by the same piece: a smaller model with fewer solutions.
    """

    def __init__(
        self,
        geometry: SweptGeometry,
        ring: Sequence[Element],
        limits: tuple[float, float],
        *,
        hubs: tuple[int, int] = (0, 0),
        one_piece: bool = False,
    ) -> None:
        self.geometry, self.ring, self.limits = geometry, tuple(ring), limits
        self.count = len(ring)
        self.milp = LinearModel()
        self._found = np.empty(0)
        self.p = self.milp.add((self.count, 2), -REACH, REACH)
        self.overlaps = geometry.overlaps(*limits)
        only = np.eye(len(geometry.pieces), dtype=bool) if one_piece else True
        self.pairs = [(int(i), int(j)) for i, j in zip(*np.nonzero(geometry.meeting & only), strict=True)]
        self.feasible = bool(self.overlaps) and bool(self.pairs)
        if self.feasible:
            self._keep_on_ends()
            self._choose_regions_and_pieces()
            self._loop()
            self._winding()
            self._fill(0, hubs[0])
            self._fill(1, hubs[1])

    def finger(self, index: int) -> IntArray:
        """Variables (2,) of a searched finger."""
        return self.p[[e.finger for e in self.ring].index(index)]

    def _keep_on_ends(self) -> None:
        for n, element in enumerate(self.ring):
            if element.ends is not None:
                a, b = element.ends
                along = self.milp.add((1,), 0.0, 1.0)
                self.milp.equal([(1.0, self.p[n]), (a - b, np.repeat(along, 2))], a)

    def _choose_regions_and_pieces(self) -> None:
        """Non-penetration at the start: W = 1 => p in its region; entry and exit pieces meet."""
        m, n = self.milp, self.count
        regions = self.geometry.regions
        self.R = m.binaries(n, len(regions))
        self.W = m.add((n, len(regions), len(self.pairs)), 0.0, 1.0)
        m.equal([(1.0, self.R)], np.ones(n))
        m.equal([(1.0, self.W), (-1.0, self.R[..., None])], np.zeros((n, len(regions))))
        s = m.add((n, len(regions), 2), -REACH, REACH)
        m.equal([(1.0, self.p), (-1.0, np.swapaxes(s, 1, 2))], np.zeros((n, 2)))
        for d in range(2):
            for sign in (1.0, -1.0):
                m.at_most([(sign, s[..., d]), (-REACH, self.R)], np.zeros(self.R.shape))
        for r, region in enumerate(regions):
            for a, b in zip(region.A, region.b, strict=True):
                m.at_most([(a, s[:, r]), (-b, self.R[:, r, None])], np.zeros(n))

    def _loop(self) -> None:
        """Exactly one pair of pieces joins neighbours, for all orientations: H = 1 => p[n] - p[n+1] in K_ij."""
        m, n = self.milp, self.count
        keys = list(self.overlaps)
        self.H = m.binaries(n, len(keys))
        m.equal([(1.0, self.H)], np.ones(n))
        d = m.add((n, len(keys), 2), -2 * REACH, 2 * REACH)
        following = np.roll(self.p, -1, axis=0)
        m.equal([(1.0, self.p), (-1.0, following), (-1.0, np.swapaxes(d, 1, 2))], np.zeros((n, 2)))
        apart = np.array([not element.joined for element in self.ring])
        for k, key in enumerate(keys):
            for a, b in zip(*self.overlaps[key], strict=True):
                m.at_most([(a, d[apart, k]), (-b, self.H[apart, k, None])], np.zeros(apart.sum()))
        for joined in np.flatnonzero(~apart):
            self._stay_on_wall(int(joined), keys)
        join_pieces(m, len(self.geometry.pieces), self.H, keys, self.W, self.pairs)

    def _stay_on_wall(self, c: int, keys: list[tuple[int, int]]) -> None:
        """Between its two points a wall's obstacle (segment - piece) is convex: same piece, same region."""
        other = [k for k, (i, j) in enumerate(keys) if i != j]
        if other:
            self.milp.equal([(1.0, self.H[c, other])], np.zeros(len(other)))
        following = (c + 1) % self.count
        self.milp.equal([(1.0, self.R[c]), (-1.0, self.R[following])], np.zeros(self.R.shape[1]))

    def _winding(self) -> None:
        """Winding number one about the start, from directions that are linear in W."""
        m, n = self.milp, self.count
        alpha = self.geometry.directions
        entry, exit_ = (np.array([pair[e] for pair in self.pairs]) for e in (0, 1))
        into = np.broadcast_to(alpha[:, entry].reshape(1, -1), (n, alpha[:, entry].size))
        out = np.broadcast_to(alpha[:, exit_].reshape(1, -1), into.shape)
        wind_once(m, self.W.reshape(n, -1), into, out)

    def _fill(self, end: int, hub: int) -> None:
        """At a limit each triangle has a point y in the pieces named for it: R^T (p - y) in the piece, W deciding which."""
        turn = rotation(self.limits[end])
        for triangle in triangles(self.count, hub):
            y = self.milp.add((2,), -2 * REACH, 2 * REACH)
            for c, part in triangle:
                f = self.milp.add((len(self.pairs), 2), -2 * REACH, 2 * REACH)
                for d in range(2):
                    terms: list[Term] = [(turn[:, d], self.p[c]), (-turn[:, d], y), (-1.0, f[:, d])]
                    self.milp.equal(terms, 0.0)
                for q, (i, j) in enumerate(self.pairs):
                    A, b = self.geometry.common(*{"entry": (i, i), "exit": (j, j), "both": (i, j)}[part])
                    inside = np.broadcast_to(f[q], A.shape)
                    chosen = np.broadcast_to(self.W[c, :, q], (len(b), self.W.shape[1]))
                    self.milp.at_most([(A, inside), (-b[:, None], chosen)], np.zeros(len(b)))

    def leftmost_first(self, others: Sequence[int]) -> None:
        """Break the symmetry of renaming: element 0 is left of the others."""
        first = np.broadcast_to(self.p[0, 0], (len(others),))
        self.milp.at_most([(1.0, first), (-1.0, self.p[list(others), 0])], np.zeros(len(others)))

    def propose(self, solver: Solver, time_limit: float) -> Proposal:
        """Searched fingers in the order of their indices, and how the loop passes along the ring."""
        answer = self.milp.solve(solver, time_limit=time_limit)
        if answer.x is None:
            return Proposal(status=answer.status)
        self._found = answer.x
        searched = sum(element.finger is not None for element in self.ring)
        fingers = np.array([answer.x[self.finger(k)] for k in range(searched)]).reshape(-1, 2)
        return Proposal(status=answer.status, fingers=fingers, meetings=self._meetings(answer.x))

    def _meetings(self, x: Array) -> tuple[Meeting, ...]:
        keys = list(self.overlaps)
        return tuple(
            Meeting(element=n, piece=keys[k][0], next_element=(n + 1) % self.count, next_piece=keys[k][1])
            for n, k in enumerate(x[self.H].argmax(axis=1))
        )

    def cut_off(self) -> None:
        """Never again the last proposal's regions and meetings."""
        on = np.concatenate([v.ravel()[self._found[v.ravel()] > 0.5] for v in (self.R, self.H)])
        self.milp.at_most([(1.0, on)], len(on) - 1.0)
