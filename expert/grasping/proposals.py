"""Finger paths worth checking, the most promising first: what each method offers to `expert.grasping.synthesis`."""

import itertools
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from expert.errors import InvalidProblem, SolverFailed
from expert.geometry.polygon import signed_area
from expert.geometry.pose import Array
from expert.grasping.cell import GoalCell
from expert.grasping.decomposed import smooth_path, topologies
from expert.grasping.facets import Facets
from expert.grasping.goal_cell import (
    DIRECTIONS,
    REACH,
    Candidate,
    can_end,
    candidate,
    cells,
    hold,
    largest_start,
    region,
)
from expert.grasping.gripper import Places, jaws, placements
from expert.grasping.nested import FacetGeometry, Grasp, schedule
from expert.grasping.smooth import acceleration, smoothest
from expert.grasping.thesis import Name, solutions
from expert.problems.grasp import GraspProblem
from expert.world.frame import Frame

ENLARGED = 10
"""So many goal cells, the best by 5-CT16, have the area of their start maximised."""
FIRMNESS = 0.5
"""Share of the largest moment that could hold the object in the end which smoothing must leave."""
BATCH, MIP_SECONDS = 24, 5.0
"""The decomposed search ranks so many grasps at once, and gives each choice of a topology this long [s]."""
PROGRAM_SHARE = 0.2
"""Share of the time limit that each program of MIQP1 and MIQP2 may take."""
SHARES = (0.98, 0.75)
"""Shares of its region of attraction that a path of the decomposed search is tried with."""


@dataclass(frozen=True)
class Proposal:
    """Relative path (K, N, 2), object facet of each finger, relative region of attraction (M, 2) at the goal's angle."""

    path: Array
    facets: tuple[int, ...]
    starts: Array
    method: str

    def labelled(self, places: Places) -> "Proposal":
        """The same with the fingers in the order of the problem."""
        order = list(places)
        return replace(self, path=self.path[:, order], facets=tuple(self.facets[k] for k in order))

    @property
    def area(self) -> float:
        """Area of the region of attraction at the goal's angle."""
        return abs(signed_area(self.starts)) if len(self.starts) > 2 else 0.0


@dataclass(frozen=True)
class Search:
    """The problem in relative lengths, and when to stop."""

    problem: GraspProblem
    deadline: float

    @cached_property
    def frame(self) -> Frame:
        """Similarity to relative lengths about the goal."""
        return Frame.of(self.problem.shape, self.problem.pose)

    @cached_property
    def table(self) -> Facets:
        """The object's facets."""
        return Facets.of(self.frame.body(self.problem.shape.vertices))

    @cached_property
    def margin(self) -> float:
        """The problem's margin, relative to the enclosing radius."""
        return self.problem.margin * self.problem.shape.size / self.frame.radius

    @property
    def left(self) -> float:
        """Time that is left [s]."""
        return self.deadline - time.perf_counter()

    @property
    def by_acceleration(self) -> bool:
        """Whether smooth paths are wanted rather than a large start."""
        return self.problem.cost == "acceleration"

    def cells(self) -> Iterator[tuple[GoalCell, Places]]:
        """Facets and rays, the firmest first, with every way to put labelled fingers there."""
        ways = placements(self.problem)
        ranked = sorted(cells(self.table, self.problem.count, self.margin), key=lambda c: -hold(c))
        for cell, places in itertools.product(ranked, ways):
            held = None
            if self.problem.grippers:
                middles = 0.5 * (self.table.low + self.table.high)[:, None] * self.table.tangents
                feet = middles + self.table.offsets[:, None] * self.table.normals
                held = jaws(self.problem, self.frame, places, feet[list(cell.chosen)])
            labelled = replace(cell, jaws=held)
            if held is None or can_end(labelled):
                yield labelled, places


def goal_cells(search: Search) -> Iterator[Proposal]:
    """Goal cells in the order of the area of their start, or of their smoothness."""
    found: list[tuple[Candidate, Places]] = []
    for cell, places in search.cells():
        if search.left <= 0:
            break
        known = candidate(cell, search.problem.half_ranges)
        if known is not None:
            found.append((known, places))
    found.sort(key=lambda entry: -entry[0].attraction)
    if search.by_acceleration:
        smooth = [p for entry in found if (p := _path_of_cell(search, *entry))]
        yield from sorted(smooth, key=lambda p: acceleration(p.path))
        return
    for entries in (_enlarged(search, found[:ENLARGED]), found[ENLARGED:]):
        for entry in entries:
            proposal = _path_of_cell(search, *entry)
            if proposal is not None:
                yield proposal


def _enlarged(search: Search, found: list[tuple[Candidate, Places]]) -> list[tuple[Candidate, Places]]:
    """The same cells with the start of largest area, the largest first."""
    first = search.problem.half_ranges[0]
    sized = []
    for known, places in found:
        area, start = largest_start(known.cell, known.cell.knot(first, first), known.start)
        sized.append((area, replace(known, start=start), places))
    sized.sort(key=lambda entry: -entry[0])
    return [(known, places) for _, known, places in sized]


def _path_of_cell(search: Search, known: Candidate, places: Places) -> Proposal | None:
    ranges, cell = search.problem.half_ranges, known.cell
    reaches = np.concatenate([ranges[:1], ranges[:-2]])
    knots = [cell.knot(reach, limit) for reach, limit in zip(reaches, ranges[:-1], strict=True)]
    end = cell.end(ranges[-2], FIRMNESS * known.firmest)
    try:
        path = smoothest([*knots, end], None if search.by_acceleration else known.start)
    except SolverFailed:  # says nothing about this cell; the next one is as good
        return None
    if path is None:
        return None
    return Proposal(path, cell.chosen, region(cell, path[0]), "goal_cell").labelled(places)


def decomposed(search: Search) -> Iterator[Proposal]:
    """Nested cages over ranked final grasps, a few at a time, each answer also with smaller starts."""
    ranked = list(search.cells())
    geometry = FacetGeometry(search.table.vertices, search.margin)
    knots = schedule(search.problem.half_ranges, search.margin)
    for first in range(0, len(ranked), BATCH):
        found = []
        for cell, places in ranked[first : first + BATCH]:
            grasp = Grasp(cell.chosen, cell.up, cell.down, cell.jaws)
            for topology in topologies(geometry, grasp, knots, MIP_SECONDS):
                found.append((topology, places))
            if search.left <= 0:
                break
        found.sort(key=lambda entry: -entry[0].value)
        for (topology, places), share in itertools.product(found, SHARES):
            if search.left <= 0:
                return
            path = smooth_path(geometry, topology, knots, share)
            if path is not None:
                starts = _free_region(search, topology.grasp.facets, path[0])
                yield Proposal(path, topology.grasp.facets, starts, "decomposed").labelled(places)


def thesis(search: Search, name: Name) -> Iterator[Proposal]:
    """MIQP1 or MIQP2, each answer cut off in turn."""
    if search.problem.grippers:
        what = "a problem without grippers"
        remedy = "method: goal_cell or decomposed"
        raise InvalidProblem("method", expected=what, got=f"{name} with grippers", remedy=remedy)
    grasps = [Grasp(cell.chosen, cell.up, cell.down) for cell, _ in search.cells()]
    if not grasps:
        return
    geometry = FacetGeometry(search.table.vertices, search.margin)
    knots = schedule(search.problem.half_ranges, search.margin)
    for topology, path in solutions(geometry, grasps, knots, name, PROGRAM_SHARE * search.left):
        facets = topology.grasp.facets
        yield Proposal(path, facets, _free_region(search, facets, path[0]), name)
        if search.left <= 0:
            return


def _free_region(search: Search, facets: tuple[int, ...], p: Array) -> Array:
    """Translations r_h alpha_h (H, 2), alpha_h as large as 5-CT16 allows for fingers p (N, 2) over their facets."""
    alpha = np.full(len(DIRECTIONS), REACH)
    for f, finger in zip(facets, p, strict=True):
        region = search.table.beyond(f)
        room, speed = region.b - region.A @ finger, -region.A @ DIRECTIONS.T
        with np.errstate(divide="ignore"):
            limits = np.where(speed > 1e-9, room[:, None] / np.maximum(speed, 1e-9), REACH)
        alpha = np.minimum(alpha, limits.min(axis=0))
    return np.maximum(alpha, 0.0)[:, None] * DIRECTIONS
