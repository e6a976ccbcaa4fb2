"""MIP1 of the thesis (5.1.7), errata mended: a baseline whose answers are unverified until `expert.verify.cage.check` has spoken.

Its slices decide what it can find: limit orientations must lie on them, and the object must touch there where it stands.
Between a slice and a limit, and around other corners of the object, it proves nothing.
"""

import cvxpy as cp
import numpy as np

from expert.caging.model import Guess
from expert.caging.thesis_blocks import (
    Variables,
    continuous_boundary,
    intersections,
    leftmost_first,
    limit_contacts,
    limits,
    loop_closure,
    non_penetration,
    not_again,
    object_enclosing,
    one_intersection,
)
from expert.caging.thesis_geometry import SlicedObject
from expert.geometry.pose import Array
from expert.mip.backends import Solver
from expert.mip.block import Block
from expert.mip.solve import solve as solve_program
from expert.problems.cage import Meeting


def slices(below: float, above: float, count: int) -> Array:
    """Orientations [rad] from -below to above, evenly spaced on each side of 0, `count` of them (odd)."""
    half = count // 2 + 1
    return np.concatenate([np.linspace(-below, 0, half), np.linspace(0, above, half)[1:]])


def blocks(x: Variables, o: SlicedObject) -> list[Block]:
    """The "subject to" list of MIP1 (Thesis 5-MIP1)."""
    return [
        intersections(x, o),  # 5-CT1
        one_intersection(x),  # 5-CT2
        loop_closure(x, o),  # 5-CT3, 5-CT4
        object_enclosing(x, o),  # 5-CT5
        non_penetration(x, o),  # 5-CT6
        limits(x, o),  # 5-CT7
        limit_contacts(x, o),  # 5-CT8
        continuous_boundary(x, o),  # 5-CT9 to 5-CT11
        leftmost_first(x),
    ]


class ThesisModel:
    """MIP1 for one set of slices, as the search for cages uses it: propose fingers, cut off what was refuted."""

    def __init__(self, vertices: Array, clearance: float, angles: Array, count: int) -> None:
        self.object = SlicedObject.of(vertices, angles, clearance, count)
        self.x = Variables.of(self.object, count)
        self.blocks = blocks(self.x, self.object)

    def propose(self, solver: Solver, seconds: float) -> Guess:
        """Fingers for which every block holds, with the loop H."""
        program = cp.Problem(cp.Minimize(0), [c for b in self.blocks for c in b.constraints])
        result = solve_program(program, solver=solver, time_limit=seconds)
        if not result.found:
            return Guess(status=result.status)
        p, H = np.asarray(self.x.p.value), np.asarray(self.x.H.value)
        meetings = tuple(
            Meeting(element=int(n), piece=int(i), next_element=(int(n) + 1) % len(p), next_piece=int(j))
            for n, i, j in np.argwhere(H > 0.5)
        )
        return Guess(status=result.status, fingers=p, meetings=meetings)

    def cut_off(self) -> None:
        """Never again the last guess's loop, limit contacts and regions at the start."""
        x = self.x
        chosen = [(v, np.asarray(v.value)) for v in (x.H, x.T, x.R[self.object.start])]
        self.blocks.append(not_again(chosen))
