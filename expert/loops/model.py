"""One loop of obstacles around an object, held at every knot of a path: a cage has one knot, nested cages have many.

Why a solution cages: at each knot the loop of overlapping pieces exists at every orientation of [low, high] and moves
continuously, it winds once around the start, and beyond the limits it can be contracted inside the obstacles; so the free
component of the start can neither leave the range nor cross the loop (docs/theory/caging.md).  All lengths are relative
(`expert.world.frame`).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from expert.geometry.pose import Array
from expert.loops import blocks
from expert.loops.swept import FARTHEST, SweptGeometry
from expert.mip.affine import Affine
from expert.mip.linear import LinearModel

Range = tuple[float, float]


@dataclass(frozen=True)
class Element:
    """One point obstacle of the loop, relative: a searched finger (its index) or a point between `ends` (2, 2).

    A wall is two such points in a row, where the loop enters and where it leaves; `joined` marks the first of them.
    """

    finger: int | None = None
    ends: Array | None = None
    joined: bool = False


@dataclass(frozen=True)
class Knot:
    """Orientations [rad] about the start: the loop exists on [low, high] and is filled on each range of `below` and `above`.

    clearance: relative distance that fingers keep from the object at the start (unless `touching`), and fillings from the
    bounds of their pieces.
    """

    low: float
    high: float
    below: tuple[Range, ...]
    above: tuple[Range, ...]
    clearance: float
    touching: bool = False

    @classmethod
    def of_cage(cls, low: float, high: float, clearance: float) -> "Knot":
        """The only knot of a cage that turns from low to high."""
        return cls(low, high, ((low, low),), ((high, high),), clearance)


class LoopModel:
    """Variables p (knot, n, 2), R, W, H and the blocks of `expert.loops.blocks`; one topology for all knots.

    hubs: how the loop is filled below and above.  one_piece: it enters and leaves each element by the same piece: a smaller
    model with fewer solutions.  feasible: whether any pieces overlap at all.
    """

    def __init__(
        self,
        geometry: SweptGeometry,
        ring: Sequence[Element],
        knots: Sequence[Knot],
        *,
        hubs: tuple[int, int] = (0, 0),
        one_piece: bool = False,
    ) -> None:
        self.geometry, self.ring, self.knots, self.hubs = geometry, tuple(ring), tuple(knots), hubs
        self.count = len(ring)
        self.milp = LinearModel()
        self.p = self.milp.variables((len(knots), self.count, 2), -FARTHEST, FARTHEST)
        only = np.eye(len(geometry.pieces), dtype=bool) if one_piece else True
        self.pairs = [(int(i), int(j)) for i, j in zip(*np.nonzero(geometry.meeting & only), strict=True)]
        self._overlaps = [geometry.overlaps(knot.low, knot.high) for knot in knots]
        self.keys = [key for key in self._overlaps[0] if all(key in sets for sets in self._overlaps)]
        self.feasible = bool(self.keys) and bool(self.pairs)

    def close(self, R: Affine, places: Sequence[int]) -> None:
        """Subject to the blocks; R (n, r): which of the regions `places` each element is in, at all knots."""
        m, W = self.milp, self.milp.variables((*R.shape, len(self.pairs)), 0.0, 1.0)
        self.R, self.W = R, W
        m.add(W.sum(axis=2) == R)
        self.s = [self._beside_the_object(k, places) for k in range(len(self.knots))]
        self._one_loop()
        blocks.object_enclosing(m, W, self.pairs, self.geometry.directions[list(places)])  # 5-CT5
        for k, knot in enumerate(self.knots):
            for hub, ranges in zip(self.hubs, (knot.below, knot.above), strict=True):
                for low, high in ranges:
                    common = self.geometry.common(low, high, knot.clearance)
                    blocks.fill(m, self.p[k], W, self.pairs, hub, common)  # 5-CT7, 5-CT8

    def _beside_the_object(self, k: int, places: Sequence[int]) -> Affine:
        """Walls stay where they are, and nothing is inside the object at the start."""
        for n, element in enumerate(self.ring):
            if element.ends is not None:
                a, b = element.ends
                along = self.milp.variables((1,), 0.0, 1.0)
                self.milp.add(self.p[k, n] == a + (b - a) * along)
        clearance = 0.0 if self.knots[k].touching else self.knots[k].clearance
        regions = [self.geometry.cleared(self.geometry.regions[r], clearance) for r in places]
        return blocks.non_penetration(self.milp, self.p[k], self.R, regions)  # 5-CT6

    def _one_loop(self) -> None:
        m, H = self.milp, self.milp.binaries(self.count, len(self.keys))
        self.H = H
        m.add(H.sum(axis=1) == 1)  # 5-CT2
        joined = np.array([element.joined for element in self.ring])
        for k, sets in enumerate(self._overlaps):
            blocks.intersections(m, self.p[k], H, [sets[key] for key in self.keys], ~joined)  # 5-CT1
        self._pass_along_walls(joined)
        blocks.loop_closure(m, H, self.keys, self.W, self.pairs)  # 5-CT3, 5-CT4

    def _pass_along_walls(self, joined: np.ndarray) -> None:
        """Between its two points a wall's obstacle (segment - piece) is convex: same piece, same region."""
        other = np.array([i != j for i, j in self.keys])
        for n in np.flatnonzero(joined):
            self.milp.add(self.H[n, other] == 0)
            self.milp.add(self.R[n] == self.R[(n + 1) % self.count])
