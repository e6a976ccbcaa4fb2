"""Find finger paths that grasp with certainty: a named method proposes, the independent checker decides.

No proposal leaves as `certified` unless `expert.verify.grasp.check` has confirmed it.
"""

import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from itertools import islice

from expert.errors import InvalidProblem
from expert.geometry.pose import rotation
from expert.grasping.proposals import Proposal, Search, decomposed, goal_cells, thesis
from expert.grasping.smooth import acceleration
from expert.problems.grasp import GraspMethod, GraspOptions, GraspProblem, GraspSolution
from expert.verify.grasp.check import verify_grasp
from expert.verify.grasp.report import GraspReport

MOST_CELLS, MOST_CHECKS = 8, 20
"""Goal cells, and proposals of any other kind, that the checker sees."""
QUICK_CHECK, PATIENT_CHECK = 1.5, 8.0
"""Processor time [s] that the checker may spend on what one proposal can reach, at first and for those still in doubt."""


def solve(
    problem: GraspProblem,
    *,
    method: GraspMethod = GraspOptions.method,
    time_limit: float = GraspOptions.time_limit,
) -> GraspSolution:
    """A certified grasp, the best by the problem's cost among those that the method proposes (Thesis 5.2.5).

    goal_cell: goal cells, and the decomposed search where none of them is confirmed; the answer names what found it.
    time_limit [s].  Raises InvalidProblem for an unknown method.
    """
    if method not in METHODS:
        raise InvalidProblem("method", expected=" or ".join(METHODS), got=repr(method))
    began = time.perf_counter()
    search = Search(problem, began + time_limit)
    doubted: list[GraspSolution] = []
    for proposals in METHODS[method](search):
        found = _first_certified(search, proposals, doubted)
        if found is not None or search.left <= 0:
            break
    answer = found or _without_certificate(search, doubted)
    seconds = time.perf_counter() - began
    return replace(answer, method=answer.method or method, refuted=len(doubted), seconds=seconds)


def _first_certified(
    search: Search, proposals: Iterator[Proposal], doubted: list[GraspSolution]
) -> GraspSolution | None:
    """The first proposal that the checker confirms; the others are added to `doubted`.

    What it cannot decide quickly is put aside: mostly another proposal, hardly worse, is easier to confirm.
    """
    unsure: list[GraspSolution] = []
    for proposal in proposals:
        answer = _answer(search, proposal)
        report = _check(search, answer, QUICK_CHECK)
        if report.verdict == "certified":
            return replace(answer, status="certified")
        doubted.append(replace(answer, reason=report.reason))
        if report.verdict == "unknown":
            unsure.append(answer)
        if search.left <= 0:
            return None
    for answer in unsure:
        if search.left > 0 and _check(search, answer, PATIENT_CHECK).verdict == "certified":
            doubted.pop()
            return replace(answer, status="certified")
    return None


def _check(search: Search, answer: GraspSolution, seconds: float) -> GraspReport:
    return verify_grasp(search.problem, answer.path, answer.facets, full=False, time_limit=seconds)


def _without_certificate(search: Search, doubted: list[GraspSolution]) -> GraspSolution:
    """The first answer that was not confirmed, or why there is none."""
    if doubted:
        return doubted[0]
    if search.left <= 0:
        reason = "the time limit was reached before any grasp was found"
        return GraspSolution(status="time_limit", reason=reason)
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


METHODS: dict[GraspMethod, Callable[[Search], Iterable[Iterator[Proposal]]]] = {
    "goal_cell": lambda search: (
        islice(goal_cells(search), MOST_CELLS),
        islice(decomposed(search), MOST_CHECKS),
    ),
    "decomposed": lambda search: (islice(decomposed(search), MOST_CHECKS),),
    "miqp1": lambda search: (islice(thesis(search, "miqp1"), MOST_CHECKS),),
    "miqp2": lambda search: (islice(thesis(search, "miqp2"), MOST_CHECKS),),
}
"""Families of proposals of each method, in the order in which they are tried."""
