"""The cage as a mixed-integer program: a loop with one knot, whose every element chooses its region at the start."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from expert.geometry.pose import Array
from expert.loops.model import Element, Knot, LoopModel
from expert.loops.swept import SweptGeometry
from expert.mip.affine import Affine
from expert.mip.backends import Solver, Status
from expert.problems.cage import Meeting


@dataclass(frozen=True, kw_only=True)
class Guess:
    """A model's answer before anyone has verified it: relative fingers (count, 2), None without any, and the loop."""

    status: Status
    fingers: Array | None = None
    meetings: tuple[Meeting, ...] = ()


class SweptModel(LoopModel):
    """The loop for one range of orientations [rad]: see `expert.loops.model`."""

    def __init__(
        self,
        geometry: SweptGeometry,
        ring: Sequence[Element],
        limits: tuple[float, float],
        *,
        hubs: tuple[int, int] = (0, 0),
        one_piece: bool = False,
    ) -> None:
        knot = Knot.of_cage(*limits, geometry.clearance)
        super().__init__(geometry, ring, [knot], hubs=hubs, one_piece=one_piece)
        self._found = np.empty(0)
        if self.feasible:
            places = range(len(geometry.regions))
            R = self.milp.binaries(self.count, len(places))
            self.milp.add(R.sum(axis=1) == 1)
            self.close(R, places)

    def finger(self, index: int) -> Affine:
        """Variables (2,) of a searched finger."""
        return self.p[0, [element.finger for element in self.ring].index(index)]

    def leftmost_first(self, others: Sequence[int]) -> None:
        """Break the symmetry of renaming: element 0 is left of the others."""
        self.milp.add(self.p[0, 0, 0] <= self.p[0, list(others), 0])

    def propose(self, solver: Solver, seconds: float) -> Guess:
        """Searched fingers in the order of their indices, and how the loop passes along the ring."""
        answer = self.milp.solve(solver, time_limit=seconds)
        if answer.x is None:
            return Guess(status=answer.status)
        self._found = answer.x
        searched = sum(element.finger is not None for element in self.ring)
        fingers = np.array([self.finger(k).at(answer.x) for k in range(searched)]).reshape(-1, 2)
        keys = [self.keys[k] for k in self.H.at(answer.x).argmax(axis=1)]
        meetings = tuple(
            Meeting(element=n, piece=i, next_element=(n + 1) % self.count, next_piece=j)
            for n, (i, j) in enumerate(keys)
        )
        return Guess(status=answer.status, fingers=fingers, meetings=meetings)

    def cut_off(self) -> None:
        """Never again the last guess's regions and meetings."""
        self.milp.exclude(self._found, self.R, self.H)
