"""Find finger paths that grasp with certainty: a named method proposes, the independent checker decides.

No proposal leaves as `certified` unless `expert.verify.grasp.check` has confirmed it.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from itertools import islice

from expert.budget import Budget
from expert.errors import InvalidProblem
from expert.geometry.pose import rotation
from expert.grasping.proposals import (
    Proposal,
    RelativeProblem,
    decomposed,
    goal_cells,
    narrower,
    thesis,
)
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

    goal_cell: goal cells; where none of them is confirmed, goal cells that keep the object within narrower ranges than it
    may use, and then the decomposed search, whose answers are preferred.  The answer names what found it.
    time_limit [s]: processor time.  Raises InvalidProblem for an unknown method.
    """
    if method not in METHODS:
        raise InvalidProblem("method", expected=" or ".join(METHODS), got=repr(method))
    task = RelativeProblem(problem, Budget(time_limit))
    doubted: list[GraspSolution] = []
    best: tuple[float, GraspSolution] = 0.0, GraspSolution(status="none_found")
    for proposals in METHODS[method](task):
        found = _first_certified(task, proposals, doubted)
        best = max(best, found, key=lambda entry: entry[0])
        if best[0] == 1 or task.budget.over:
            break
    answer = best[1] if best[0] > 0 else _without_certificate(task, doubted)
    return replace(answer, method=answer.method or method, refuted=len(doubted), seconds=task.budget.spent)


def _first_certified(
    task: RelativeProblem, proposals: Iterator[Proposal], doubted: list[GraspSolution]
) -> tuple[float, GraspSolution]:
    """The first proposal that the checker confirms, and its share of the half-ranges; the others are added to `doubted`.

    What it cannot decide quickly is put aside: mostly another proposal, hardly worse, is easier to confirm.
    """
    unsure: list[tuple[float, GraspSolution]] = []
    for proposal in proposals:
        answer = _answer(task, proposal)
        report = _check(task, answer, QUICK_CHECK)
        if report.verdict == "certified":
            return proposal.share, replace(answer, status="certified")
        doubted.append(replace(answer, reason=report.reason))
        if report.verdict == "unknown":
            unsure.append((proposal.share, answer))
        if task.budget.over:
            break
    for share, answer in unsure:
        if not task.budget.over and _check(task, answer, PATIENT_CHECK).verdict == "certified":
            doubted.pop()
            return share, replace(answer, status="certified")
    return 0.0, GraspSolution(status="none_found")


def _check(task: RelativeProblem, answer: GraspSolution, seconds: float) -> GraspReport:
    return verify_grasp(
        task.problem, answer.path, answer.facets, full=False, time_limit=seconds, budget=task.budget
    )


def _without_certificate(task: RelativeProblem, doubted: list[GraspSolution]) -> GraspSolution:
    """The first answer that was not confirmed, or why there is none."""
    if doubted:
        return doubted[0]
    if task.budget.over:
        reason = "the time limit was reached before any grasp was found"
        return GraspSolution(status="time_limit", reason=reason)
    return GraspSolution(status="none_found", reason="no grasp of the kind searched for; others may exist")


def _answer(task: RelativeProblem, proposal: Proposal) -> GraspSolution:
    frame = task.frame
    path = frame.world(proposal.path)
    return GraspSolution(
        status="uncertified",
        path=path,
        facets=proposal.facets,
        starts=frame.radius * proposal.starts @ rotation(frame.pose[2]).T,
        objective=acceleration(path) if task.by_acceleration else proposal.area * frame.radius**2,
        method=proposal.method,
        reason="" if proposal.share == 1 else f"keeps within {proposal.share:.3g} of the half-ranges",
    )


METHODS: dict[GraspMethod, Callable[[RelativeProblem], Iterable[Iterator[Proposal]]]] = {
    "goal_cell": lambda task: (
        islice(goal_cells(task), MOST_CELLS),
        narrower(task),
        islice(decomposed(task), MOST_CHECKS),
    ),
    "decomposed": lambda task: (islice(decomposed(task), MOST_CHECKS),),
    "miqp1": lambda task: (islice(thesis(task, "miqp1"), MOST_CHECKS),),
    "miqp2": lambda task: (islice(thesis(task, "miqp2"), MOST_CHECKS),),
}
"""Families of proposals of each method, in the order in which they are tried."""
