"""Where an object can be while fingers move: floods forward over slabs of the path parameter, from outside.

Slabs are as long as they can be: where the flood of one leaves the orientations allowed or is unbounded, cells on its way
are halved, and when they are no coarser than the fingers' motion, the slab is.
"""

from dataclasses import dataclass, field

import numpy as np
import shapely

from expert.budget import UNLIMITED, Budget
from expert.errors import OutOfTime
from expert.geometry.pose import Array
from expert.verify.cage.cells import DEGREE, TURN, Cell
from expert.verify.cage.search import UNIT
from expert.verify.grasp.finger_path import FingerPath
from expert.verify.grasp.pockets import NONE, Pockets
from expert.verify.grasp.slab import Reached, Slab, SlabFlood, coarsened, uniform_ring

COARSEST, FINEST = 4 * DEGREE, DEGREE // 16
"""Widths of the widest and of the narrowest cells that are of use."""
LEAST_SLACK = 1e-5
"""Slabs in which fingers move by less than twice this relative length (at first ten times as far) are not halved."""
ROOM = 0.1
"""What is reached in a slab may go beyond what its sources cover by this relative length."""
NEAR_GOAL: Reached = {
    Cell(0, FINEST): [shapely.Point(0, 0)],
    Cell(TURN - FINEST, FINEST): [shapely.Point(0, 0)],
}


@dataclass
class Tube:
    """Slabs in order of s.  leak: parameters of a slab in which the flood escapes at the finest resolution, or at which
    time was up.
    """

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


def reach_tube(
    path: FingerPath, limits: Array, coarsest: int, budget: Budget, pockets: Pockets = NONE
) -> Tube:
    """Flood from the goal's component at s = 0 to the end; orientations beyond a limit [rad] count as escaped.

    limits: for each segment between knots.  coarsest: width of the widest cells, in units of the cage verifier; below
    COARSEST fingers move by no more in a slab.  budget: when it is over the tube is given up.  pockets: what reaches them
    counts as escaped.
    """
    tube = Tube()
    first_round = coarsest == COARSEST
    longest, shortest = (np.inf, 10 * LEAST_SLACK) if first_round else (2 * coarsest * UNIT, LEAST_SLACK)
    first = first_slab(path, coarsest, limits[0], pockets.at(0.0, 0.0), budget)
    if first is None:
        tube.leak = 0.0, 0.0
        return tube
    sources, ring, s = first.reached, first.ring, 0.0
    stride = 16 * UNIT * min(cell.width for cell in ring) / max(_motion(path, 0.0, 1.0), LEAST_SLACK)
    while s < path.last:
        knot = float(int(s) + 1)
        stride = min(stride, longest / max(_motion(path, knot - 1, knot), LEAST_SLACK))
        high = s + stride if stride < 0.999 * (knot - s) else knot
        slab = settled_slab(path, s, high, ring, sources, limits[int(s)], pockets.at(s, high), budget)
        if slab is None:
            stride = 0.5 * (high - s)
        if budget.over or (slab is None and _motion(path, s, high) < 2 * shortest):
            tube.leak = s, high
            return tube
        if slab is not None:
            tube.slabs.append(slab)
            sources, ring, s, stride = slab.reached, coarsened(slab.ring, coarsest), high, 2 * (high - s)
    return tube


def first_slab(path: FingerPath, coarsest: int, limit: float, avoid: Array, budget: Budget) -> Slab | None:
    """What is reached at s = 0 from the goal, in cells that are fine only where they must be.

    The way of a leak that begins at the goal says little about where cells are too wide, so all of them are halved.  One
    that begins at what is known to be enough says more: coarse cells are tried once more from there.
    """
    ring = uniform_ring(coarsest)
    fine = settled_slab(path, 0.0, 0.0, ring, NEAR_GOAL, limit, avoid, budget, confirmed=False)
    if fine is None:
        return None
    sparse = settled_slab(path, 0.0, 0.0, ring, fine.reached, limit, avoid, budget, confirmed=False)
    return settled_slab(path, 0.0, 0.0, (sparse or fine).ring, NEAR_GOAL, limit, avoid, budget)


def settled_slab(
    path: FingerPath,
    low: float,
    high: float,
    ring: list[Cell],
    sources: Reached,
    limit: float,
    avoid: Array = NONE.configurations,
    budget: Budget = UNLIMITED,
    *,
    confirmed: bool = True,
) -> Slab | None:
    """What is reached in [low, high] from sources at low; None where it is not held with cells as fine as the motion.

    Overlays in plain doubles find the cells that are needed, and overlays on a grid confirm what they find.
    Nor is it where the budget is over before that is known.
    """
    try:
        return _settled(
            SlabFlood(path, low, high, ring, _around(sources), budget), sources, limit, avoid, confirmed
        )
    except OutOfTime:
        return None


def _settled(flood: SlabFlood, sources: Reached, limit: float, avoid: Array, confirmed: bool) -> Slab | None:
    finest = FINEST
    while finest * UNIT <= flood.slack and finest < COARSEST:
        finest *= 2
    while True:
        way = flood.flood(sources, limit, avoid)
        if way is None and (flood.on_grid or not confirmed):
            return flood.slab()
        if way is None:
            flood.repeat_on_grid()
            continue
        widest = max(cell.width for cell, _ in way)
        if widest <= finest or flood.leaks_anyway(way[0][0]):
            return None
        flood.split({cell for cell, _ in way if cell.width == widest})


def _around(sources: Reached) -> shapely.Polygon | None:
    """A box that holds with room what is reached soon after the sources; none for the mere goal."""
    if sources is NEAR_GOAL:
        return None
    corners = shapely.get_coordinates([p for polygons in sources.values() for p in polygons])
    return shapely.box(*(corners.min(axis=0) - ROOM), *(corners.max(axis=0) + ROOM))


def _motion(path: FingerPath, low: float, high: float) -> float:
    return float(abs(path.fingers(high) - path.fingers(low)).max())
