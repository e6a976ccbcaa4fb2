"""Find finger paths that grasp with certainty: a named method proposes, the independent checker decides.

No proposal leaves as `certified` unless `expert.verify.grasp` has confirmed it.
"""

import itertools
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Literal

from expert.errors import InvalidProblem
from expert.geometry.pose import rotation
from expert.grasping.problem import GraspProblem, GraspSolution
from expert.grasping.proposals import Proposal, Search, decomposed, goal_cells, thesis
from expert.grasping.smooth import acceleration
from expert.verify.grasp import verify_grasp

Method = Literal["goal_cell", "decomposed", "miqp1", "miqp2"]
MOST_CELLS = 8
"""Goal cells that the checker sees before the decomposed search takes over."""
CHECK_SECONDS = 6.0
"""Processor time that the checker may spend on what one proposal can reach: another one is often easier to confirm."""
MOST_CHECKS = 20
"""Proposals that the checker sees before the search gives up."""


def solve(problem: GraspProblem, *, method: Method = "goal_cell", time_limit: float = 30.0) -> GraspSolution:
    """A certified grasp, the best by the problem's cost among those that the method proposes (Thesis 5.2.5).

    goal_cell: goal cells, and the decomposed search where none of them is confirmed; the answer names what found it.
    time_limit [s].  Raises InvalidProblem for an unknown method.
    """
    if method not in METHODS:
        raise InvalidProblem("method", expected=" or ".join(METHODS), got=repr(method))
    began = time.perf_counter()
    search = Search(problem, began + time_limit)
    answer = _first_certified(search, METHODS[method](search))
    return replace(answer, method=answer.method or method, seconds=time.perf_counter() - began)


def _first_certified(search: Search, proposals: Iterator[Proposal]) -> GraspSolution:
    doubted = 0
    kept: GraspSolution | None = None
    for proposal in itertools.islice(proposals, MOST_CHECKS):
        answer = _answer(search, proposal)
        report = verify_grasp(
            search.problem, answer.path, answer.facets, full=False, time_limit=CHECK_SECONDS
        )
        if report.verdict == "certified":
            return replace(answer, status="certified", refuted=doubted)
        doubted += 1
        kept = kept or replace(answer, reason=report.reason)
        if search.left <= 0:
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
    path = frame.world(proposal.path)
    return GraspSolution(
        status="uncertified",
        path=path,
        facets=proposal.facets,
        starts=frame.radius * proposal.starts @ rotation(frame.pose[2]).T,
        objective=acceleration(path) if search.by_acceleration else proposal.area * frame.radius**2,
        method=proposal.method,
    )


def _cells_then_cages(search: Search) -> Iterator[Proposal]:
    yield from itertools.islice(goal_cells(search), MOST_CELLS)
    yield from decomposed(search)


METHODS: dict[str, Callable[[Search], Iterator[Proposal]]] = {
    "goal_cell": _cells_then_cages,
    "decomposed": decomposed,
    "miqp1": lambda search: thesis(search, "miqp1"),
    "miqp2": lambda search: thesis(search, "miqp2"),
}
