"""Finger paths worth checking, the most promising first: what each method offers to `expert.grasping.synthesis`."""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Generic, TypeVar

import numpy as np

from expert.budget import Budget
from expert.errors import InvalidProblem, SolverFailed
from expert.geometry.polygon import signed_area
from expert.geometry.pose import Array
from expert.grasping.cell import LEAST_MOMENT, GoalCell
from expert.grasping.decomposed import smooth_path, topologies
from expert.grasping.facets import Facets
from expert.grasping.goal_cell import (
    DIRECTIONS,
    Candidate,
    can_end,
    candidate,
    cells,
    hold,
    largest_start,
    region,
)
from expert.grasping.gripper import Places, jaws, placements
from expert.grasping.nested import FacetGeometry, schedule
from expert.grasping.smooth import acceleration, smoothest
from expert.grasping.thesis import Name, solutions
from expert.loops.swept import FARTHEST
from expert.problems.grasp import GraspProblem
from expert.world.frame import Frame

ENLARGED = 10
"""So many goal cells, the best by 5-CT16, have the area of their start maximised."""
FIRMNESS = 0.5
"""Share of the largest moment that could hold the object in the end which smoothing must leave."""
LOOKING, MOST_CANDIDATES = 0.3, 1500
"""Share of what is left of the time in which goal cells are looked for, and how many are enough."""
NARROWER, MOST_NARROW = (0.75, 0.5, 0.3, 0.15, 0.07), 4
"""Shares of the half-ranges that are tried where the whole is not found, and goal cells of each that are offered."""
SLIGHT_MOMENT = 0.01
"""Moment (relative length) that holds an object in the end which allows no more, being thin."""
TRYING, MOST_PIECES, MOST_GRASPS = 0.4, 6, 500
"""The decomposed search takes this share of what is left of the time; pieces and grasps that nested cages choose among."""
BATCH, MIP_SECONDS = 24, 5.0
"""The decomposed search ranks so many grasps at once, and gives each choice of a topology this long [s]."""
SHARES = (0.98, 0.75)
"""Shares of its region of attraction that a path of the decomposed search is tried with."""


T = TypeVar("T")


@dataclass(frozen=True)
class Proposal:
    """Relative path (K, N, 2), object facet of each finger, relative region of attraction (M, 2) at the goal's angle.

    share: of the half-ranges asked for, within which it keeps the object.
    """

    path: Array
    facets: tuple[int, ...]
    starts: Array
    method: str
    share: float = 1.0

    def labelled(self, places: Places) -> "Proposal":
        """The same with the fingers in the order of the problem."""
        order = list(places)
        return replace(self, path=self.path[:, order], facets=tuple(self.facets[k] for k in order))

    @property
    def area(self) -> float:
        """Area of the region of attraction at the goal's angle."""
        return abs(signed_area(self.starts)) if len(self.starts) > 2 else 0.0


@dataclass(frozen=True)
class RelativeProblem:
    """The problem in relative lengths, and what may be spent on it."""

    problem: GraspProblem
    budget: Budget

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
    def by_acceleration(self) -> bool:
        """Whether smooth paths are wanted rather than a large start."""
        return self.problem.cost == "acceleration"

    @cached_property
    def _ranked(self) -> list[GoalCell]:
        for least in (LEAST_MOMENT, SLIGHT_MOMENT):
            found = cells(self.table, self.problem.count, self.margin, least, self.budget)
            by_hold = [(hold(cell), cell) for cell in found]
            if by_hold:
                break
        return [cell for _, cell in sorted(by_hold, key=lambda entry: -entry[0])]

    def cells(self) -> Iterator[tuple[GoalCell, Places]]:
        """Facets and rays, the firmest first, with every way to put labelled fingers there."""
        for known in self._worked_out:
            if self.budget.over:
                return
            yield known

    @cached_property
    def _worked_out(self) -> "Remembered[tuple[GoalCell, Places]]":
        """What grippers do to a cell is worked out once, when it is first asked for."""
        return Remembered(self._labelled())

    def _labelled(self) -> Iterator[tuple[GoalCell, Places]]:
        middles = 0.5 * (self.table.low + self.table.high)[:, None] * self.table.tangents
        feet = middles + self.table.offsets[:, None] * self.table.normals
        for cell, places in itertools.product(self._ranked, placements(self.problem)):
            if self.budget.over:
                return
            if not self.problem.grippers:
                yield cell, places
                continue
            held = replace(cell, jaws=jaws(self.problem, self.frame, places, feet[list(cell.chosen)]))
            if can_end(held):
                yield held, places


class Remembered(Generic[T]):
    """An iterator's items, for any number of loops: each is made when the first of them comes to it."""

    def __init__(self, source: Iterator[T]) -> None:
        self._source, self._known = source, list[T]()

    def __iter__(self) -> Iterator[T]:
        for k in itertools.count():
            if k == len(self._known):
                self._known.extend(itertools.islice(self._source, 1))
            if k == len(self._known):
                return
            yield self._known[k]


def goal_cells(task: RelativeProblem, share: float = 1.0) -> Iterator[Proposal]:
    """Goal cells in the order of the area of their start, or of their smoothness.

    share: of the half-ranges asked for, within which they keep the object.
    """
    ranges = share * task.problem.half_ranges
    found: list[tuple[Candidate, Places]] = []
    looking = task.budget.part(LOOKING * task.budget.left)
    for cell, places in task.cells():
        if looking.over or len(found) == MOST_CANDIDATES:
            break
        known = candidate(cell, ranges)
        if known is not None:
            found.append((known, places))
    found.sort(key=lambda entry: -entry[0].attraction)
    if task.by_acceleration:
        smooth = [p for entry in found if not task.budget.over and (p := _path_of_cell(task, *entry, share))]
        yield from sorted(smooth, key=lambda p: acceleration(p.path))
        return
    for entries in (_enlarged(task, found[:ENLARGED], ranges[0]), found[ENLARGED:]):
        for entry in entries:
            proposal = _path_of_cell(task, *entry, share)
            if proposal is not None:
                yield proposal


def _enlarged(
    task: RelativeProblem, found: list[tuple[Candidate, Places]], first: float
) -> list[tuple[Candidate, Places]]:
    """The same cells with the start of largest area for the first half-range [rad], the largest first."""
    sized = []
    for known, places in found:
        if task.budget.over:
            break
        area, start = largest_start(known.cell, known.cell.knot(first, first), known.start)
        sized.append((area, replace(known, start=start), places))
    sized.sort(key=lambda entry: -entry[0])
    return [(known, places) for _, known, places in sized]


def _path_of_cell(task: RelativeProblem, known: Candidate, places: Places, share: float) -> Proposal | None:
    ranges, cell = share * task.problem.half_ranges, known.cell
    reaches = np.concatenate([ranges[:1], ranges[:-2]])
    knots = [cell.knot(reach, limit) for reach, limit in zip(reaches, ranges[:-1], strict=True)]
    end = cell.end(ranges[-2], FIRMNESS * known.firmest)
    try:
        path = smoothest([*knots, end], None if task.by_acceleration else known.start)
    except SolverFailed:  # says nothing about this cell; the next one is as good
        return None
    if path is None:
        return None
    return Proposal(path, cell.chosen, region(cell, path[0]), "goal_cell", share).labelled(places)


def narrower(task: RelativeProblem) -> Iterator[Proposal]:
    """Goal cells, then nested cages, that keep the object within smaller ranges than it may use, the widest first.

    Where facets are short no others may exist: a regular polygon of many facets and a thin rectangle allow nothing else.
    """
    for share in NARROWER:
        if not task.budget.over:
            yield from itertools.islice(goal_cells(task, share), MOST_NARROW)
    for share in NARROWER:
        if not task.budget.over:
            yield from itertools.islice(decomposed(task, share), MOST_NARROW)


def decomposed(task: RelativeProblem, share: float = 1.0) -> Iterator[Proposal]:
    """Nested cages over ranked final grasps, a few at a time, each answer also with smaller starts.

    share: of the half-ranges asked for, within which they keep the object.
    """
    budget = task.budget.part(TRYING * task.budget.left)
    ranked = list(task.cells())
    if task.budget.over:
        return
    geometry = FacetGeometry(task.table.vertices, task.margin, MOST_PIECES)
    knots = schedule(share * task.problem.half_ranges, task.margin)
    for first in range(0, len(ranked), BATCH):
        found = []
        for cell, places in ranked[first : first + BATCH]:
            if budget.over:
                break
            for topology in topologies(geometry, cell, knots, budget.part(MIP_SECONDS)):
                found.append((topology, places))
        found.sort(key=lambda entry: -entry[0].value)
        for (topology, places), kept in itertools.product(found, SHARES):
            if budget.over:
                return
            path = smooth_path(geometry, topology, knots, kept)
            if path is not None:
                starts = _free_region(task, topology.grasp.chosen, path[0])
                yield Proposal(path, topology.grasp.chosen, starts, "decomposed", share).labelled(places)


def thesis(task: RelativeProblem, name: Name) -> Iterator[Proposal]:
    """MIQP1 or MIQP2, each answer cut off in turn."""
    if task.problem.grippers:
        what = "a problem without grippers"
        remedy = "method: goal_cell or decomposed"
        raise InvalidProblem("method", expected=what, got=f"{name} with grippers", remedy=remedy)
    grasps = [cell for cell, _ in itertools.islice(task.cells(), MOST_GRASPS)]
    if not grasps:
        return
    geometry = FacetGeometry(task.table.vertices, task.margin, MOST_PIECES)
    knots = schedule(task.problem.half_ranges, task.margin)
    for topology, path in solutions(geometry, grasps, knots, name, task.budget):
        facets = topology.grasp.chosen
        yield Proposal(path, facets, _free_region(task, facets, path[0]), name)
        if task.budget.over:
            return


def _free_region(task: RelativeProblem, facets: tuple[int, ...], p: Array) -> Array:
    """Translations r_h alpha_h (H, 2), alpha_h as large as 5-CT16 allows for fingers p (N, 2) over their facets."""
    alpha = np.full(len(DIRECTIONS), FARTHEST)
    for f, finger in zip(facets, p, strict=True):
        region = task.table.beyond(f)
        room, speed = region.b - region.A @ finger, -region.A @ DIRECTIONS.T
        with np.errstate(divide="ignore"):
            limits = np.where(speed > 1e-9, room[:, None] / np.maximum(speed, 1e-9), FARTHEST)
        alpha = np.minimum(alpha, limits.min(axis=0))
    return np.maximum(alpha, 0.0)[:, None] * DIRECTIONS
