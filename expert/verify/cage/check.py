"""Is an object caged?  Independent of how the fingers were found; never claims what it has not shown.

CAGED    no motion leaves: the free space that inner obstacles leave, too large, keeps the start in a bounded part.
ESCAPES  an explicit path to infinity, whose every move `expert.verify.cage.escape` has checked exactly.
UNKNOWN  neither, at the finest resolution or within the budget.

Overlays in plain doubles are fast and very rarely wrong, so no cage rests on them: its last flood is repeated with
overlays on a grid, which are robust, and where the two disagree the whole search is.
"""

from dataclasses import replace

import numpy as np

from expert.budget import Budget
from expert.errors import InvalidProblem, OutOfTime
from expert.problems.cage import Arrangement, CageProblem, CageSolution
from expert.verify.cage.claims import CLAIMED, unmet_claim
from expert.verify.cage.report import CageReport
from expert.verify.cage.search import UNIT, CageSearch

CELL_BUDGET = 3000
"""Cells after which the answer is UNKNOWN."""


def verify_cage(
    arrangement: Arrangement,
    *,
    slack: float = 0.0,
    range_resolution: float = np.radians(0.5),
    finest: float = np.radians(1 / 512),
    cell_budget: int = CELL_BUDGET,
    within: tuple[float, float] | None = None,
    time_limit: float = np.inf,
) -> CageReport:
    """Decide whether the object can leave its obstacles.

    slack: length [m] by which every finger may be elsewhere and a cage still be a cage; escapes are those of the fingers
    as given.  range_resolution: width [rad] to which the ends of a cage's rotation range are located.  finest: smallest
    half-width [rad] of a cell (1/512 degree at least).  cell_budget: cells after which the answer is UNKNOWN.
    within: orientations [rad], relative to the start, that the cage is expected to keep: looked at more closely where it
    seems to leave them.  time_limit [s]: processor time after which the answer is UNKNOWN.
    """
    budget, unit = Budget(time_limit), max(1, round(2 * finest / UNIT))
    search = CageSearch(arrangement, slack, unit, budget)
    try:
        verdict, path = search.run(range_resolution, cell_budget, within)
        failed = verdict == "unknown" and search.faults > 0
        if failed or (verdict == "caged" and not search.holds_on_grid()):
            search = CageSearch(arrangement, slack, unit, budget, on_grid=True)
            verdict, path = search.run(range_resolution, cell_budget, within)
    except OutOfTime:
        return CageReport(verdict="unknown", seconds=budget.spent, reason="the time limit was reached")
    return CageReport(
        verdict=verdict,
        cells=search.complex.evaluated,
        resolution=0.5 * UNIT * min(cell.width for cell in search.ahead if cell.width),
        seconds=budget.spent,
        rotation_range=search.rotation_range() if verdict == "caged" else None,
        turns_beyond=verdict == "caged" and within is not None and search.shown_beyond(within),
        path=path,
    )


def verify(task: Arrangement | CageProblem, answer: CageSolution | None = None) -> CageReport:
    """Report on given fingers, or on those that an answer claims to cage the object of a problem.

    Raises InvalidProblem where there are no fingers to check.
    """
    if isinstance(task, Arrangement):
        return verify_cage(task)
    if answer is None:
        raise InvalidProblem(
            "fingers.positions", expected="positions to verify", got="nothing", remedy="solve it first"
        )
    if not answer.found:
        raise InvalidProblem(
            "status", expected="caged", got=answer.status, remedy="there is no claim to check"
        )
    if fault := unmet_claim(task, answer):
        return CageReport(verdict="refuted", claim=answer.status, claimed=CLAIMED, reason=fault)
    return _with_range(task.arrangement(answer.fingers), answer)


def _with_range(arrangement: Arrangement, answer: CageSolution) -> CageReport:
    """Verdict on a cage and on the orientations that the answer says it keeps; none stated: it may turn freely."""
    stated = answer.rotation_range
    theta = float(arrangement.pose[2])
    within = (stated[0] - theta, stated[1] - theta) if stated is not None else None
    report = replace(verify_cage(arrangement, within=within), claim=answer.status, claimed=CLAIMED)
    if stated is None or report.rotation_range is None or _contains(stated, report.rotation_range):
        return report
    limits = "[{:.6g}, {:.6g}] deg".format(*np.degrees(stated))
    if report.turns_beyond:
        return replace(
            report, verdict="refuted", reason=f"it turns beyond {limits}, which it is said to keep"
        )
    return replace(report, verdict="unknown", reason=f"that it keeps {limits} is not shown")


def _contains(stated: tuple[float, float], shown: tuple[float, float]) -> bool:
    return stated[0] <= shown[0] + 1e-9 and shown[1] <= stated[1] + 1e-9
