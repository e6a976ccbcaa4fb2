"""Find finger paths that grasp with certainty: propose by a named method, and let the independent checker decide.

No proposal leaves as `certified` unless `expert.verify.grasp` has confirmed it.
"""

import itertools
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from expert.caging.frame import Frame
from expert.errors import InvalidProblem
from expert.geometry.pose import Array, rotation
from expert.grasping.decomposed import path_of, topologies
from expert.grasping.facets import Facets
from expert.grasping.goal_cell import DIRECTIONS, Candidate, candidate, cells, hold, region
from expert.grasping.nested import FacetGeometry, Grasp, schedule
from expert.grasping.problem import GraspProblem, GraspSolution
from expert.grasping.smooth import acceleration, smoothest
from expert.verify.grasp import verify_grasp

Method = Literal["goal_cell", "decomposed", "miqp1", "miqp2"]
BATCH, MIP_SECONDS = 8, 5.0
"""The decomposed search ranks so many grasps at once, and gives each choice of a topology this long [s]."""
SHARES = (0.98, 0.75)
"""Shares of its region of attraction that a path of the decomposed search is tried with."""
FIRMNESS = 0.5
"""Share of the largest moment that could hold the object in the end which smoothing must leave."""
MOST_CHECKS = 12
"""Proposals that the checker sees before the search gives up."""


@dataclass(frozen=True)
class Proposal:
    """Relative path (K, N, 2), object facet of each finger, relative region of attraction (M, 2) at the goal's angle."""

    path: Array
    facets: tuple[int, ...]
    starts: Array
    objective: float


@dataclass(frozen=True)
class Search:
    """The problem in relative lengths, and when to stop."""

    problem: GraspProblem
    frame: Frame
    table: Facets
    margin: float
    deadline: float

    @property
    def left(self) -> float:
        """Time that is left [s]."""
        return self.deadline - time.perf_counter()


def solve(problem: GraspProblem, *, method: Method = "goal_cell", time_limit: float = 30.0) -> GraspSolution:
    """A certified grasp, the best by the problem's cost among those that the method proposes (Thesis 5.2.5).

    Raises InvalidProblem for an unknown method.
    """
    if method not in METHODS:
        raise InvalidProblem("method", expected=" or ".join(METHODS), got=repr(method))
    began = time.perf_counter()
    frame = Frame.of(problem.shape, problem.pose)
    margin = problem.margin * problem.shape.size / frame.radius
    table = Facets.of(frame.body(problem.shape.vertices))
    search = Search(problem, frame, table, margin, began + time_limit)
    answer = _first_certified(search, METHODS[method](search))
    return replace(answer, method=method, seconds=time.perf_counter() - began)


def _first_certified(search: Search, proposals: Iterator[Proposal]) -> GraspSolution:
    doubted, reason = 0, ""
    kept: GraspSolution | None = None
    for proposal in proposals:
        answer = _answer(search, proposal)
        reason = _objection(search.problem, answer)
        if not reason:
            return replace(answer, status="certified", refuted=doubted)
        doubted += 1
        kept = kept or replace(answer, reason=reason)
        if doubted >= MOST_CHECKS or search.left <= 0:
            break
    if kept is not None:
        return replace(kept, refuted=doubted)
    if search.left <= 0:
        return GraspSolution(
            status="time_limit", reason="the time limit was reached before any grasp was found"
        )
    return GraspSolution(status="none_found", reason="no grasp of the kind searched for; others may exist")


def _answer(search: Search, proposal: Proposal) -> GraspSolution:
    frame = search.frame
    return GraspSolution(
        status="uncertified",
        path=frame.world(proposal.path),
        facets=proposal.facets,
        starts=frame.radius * proposal.starts @ rotation(frame.pose[2]).T,
        objective=proposal.objective,
    )


def _objection(problem: GraspProblem, answer: GraspSolution) -> str:
    """Why the checker does not confirm the answer; empty if it does."""
    report = verify_grasp(problem, answer.path, answer.facets, full=False)
    return "" if report.verdict == "certified" else report.reason


def _goal_cells(search: Search) -> Iterator[Proposal]:
    """Goal cells in the order of their region of attraction, or of their smoothness."""
    ranges = search.problem.half_ranges
    found: list[Candidate] = []
    for cell in cells(search.table, search.problem.count, search.margin):
        if search.left <= 0:
            break
        known = candidate(cell, ranges)
        if known is not None:
            found.append(known)
    proposals = (_smoothed(search, known) for known in sorted(found, key=lambda c: -c.attraction))
    if search.problem.cost == "acceleration":
        yield from sorted((p for p in proposals if p), key=lambda p: p.objective)
    else:
        yield from (p for p in proposals if p)


def _smoothed(search: Search, known: Candidate) -> Proposal | None:
    ranges, cell = search.problem.half_ranges, known.cell
    reaches = np.concatenate([ranges[:1], ranges[:-2]])
    knots = [cell.knot(reach, limit) for reach, limit in zip(reaches, ranges[:-1], strict=True)]
    smooth_only = search.problem.cost == "acceleration"
    path = smoothest(
        [*knots, cell.end(ranges[-2], FIRMNESS * known.firmest)], None if smooth_only else known.start
    )
    if path is None:
        return None
    radius = search.frame.radius
    value = acceleration(path) * radius**2 if smooth_only else known.attraction * radius
    return Proposal(path, cell.chosen, region(cell, path[0]), value)


def _decomposed(search: Search) -> Iterator[Proposal]:
    """Nested cages over ranked final grasps, a few at a time, each answer also with smaller starts."""
    ranked = sorted(cells(search.table, search.problem.count, search.margin), key=lambda c: -hold(c))
    grasps = [Grasp(cell.chosen, cell.up, cell.down) for cell in ranked]
    geometry = FacetGeometry(search.table.vertices, search.margin)
    knots = schedule(search.problem.half_ranges, search.margin)
    for first in range(0, len(grasps), BATCH):
        found = []
        for topology in topologies(geometry, grasps[first : first + BATCH], knots, MIP_SECONDS):
            found.append(topology)
            if search.left <= 0:
                break
        for topology, share in itertools.product(sorted(found, key=lambda t: -t.value), SHARES):
            if search.left <= 0:
                return
            path = path_of(geometry, topology, knots, share)
            if path is not None:
                starts = share * topology.alpha[:, None] * DIRECTIONS
                value = share * topology.value * search.frame.radius
                yield Proposal(path, topology.grasp.facets, starts, value)


METHODS: dict[str, Callable[[Search], Iterator[Proposal]]] = {
    "goal_cell": _goal_cells,
    "decomposed": _decomposed,
}
