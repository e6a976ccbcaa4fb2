"""The exact solver: contact positions and forces that make a motion, with a certified gap, or a proof that none do.

No envelope: with w = rho lambda_n the wrench cone of a facet is convex (see `steps`), so what remains non-convex is one rho
per contact interval, and a best-first search branches on modes, on rho and on free regions (see `search`).  Global
optimality and infeasibility detection, which Thesis 3.1.1 asks of MIQP1, hold for the exact equations.
"""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from expert.budget import Budget
from expert.contact.certificate import certificate_of
from expert.contact.plan_at import plan_at
from expert.contact.polish import mend
from expert.contact.polish import polish as polished
from expert.contact.reasons import why_infeasible
from expert.contact.scaled import ScaledTask
from expert.contact.search import Search
from expert.contact.sequence import sequence_of
from expert.contact.tree import NEGLIGIBLE, Outcome
from expert.errors import SolverFailed
from expert.geometry.pose import Array
from expert.problems.contact import ContactTask, Plan, Stated, Status
from expert.world.environment import Environment
from expert.world.fingers import Fingers
from expert.world.motion import Trajectory
from expert.world.shape import Body
from expert.world.walls import HalfPlane

STUCK = "numerical: some boxes of contact positions could be neither bounded better nor split further"
"""Why a gap stays open before the budget is spent."""


def solve(
    task: ContactTask, *, gap: float, time_limit: float, node_limit: int | None = None, polish: bool = True
) -> Plan:
    """Globally optimal plan (Thesis 3.1) to a relative `gap`; budgets in seconds and in nodes, the latter repeatable.

    polish: finish at a stationary point of the cost at the best modes.  Raises SolverFailed where numerical failures
    leave the task undecided.
    """
    warm_up()
    budget = Budget(time_limit)
    scaled = ScaledTask.of(task)
    search = Search(scaled, task.fingers.count, gap)
    outcome = search.run(budget, node_limit)
    if outcome.best.sequence is None:
        return _without_plan(task, scaled, search, outcome, budget)
    z = outcome.best.z
    if polish:
        z = polished(scaled, outcome.best.sequence, z, budget).z
    plan = _with_plan(task, scaled, outcome, z, gap)
    return replace(plan, certificate=certificate_of(search, outcome.bound, budget), seconds=budget.spent)


@cache
def warm_up() -> None:
    """Compile or load the numerical code, once a process, so that time limits and times count solving alone."""
    body, _ = Body.uniform([[0, 0], [1, 0], [0, 1]], 1.0)
    task = ContactTask(
        body=body,
        environment=Environment(walls=(HalfPlane(point=np.zeros(2), normal=np.array([0.0, 1.0])),)),
        trajectory=Trajectory.of([[0, 1, 0], [0, 1.1, 0], [0, 1.2, 0]], 1.0),
        fingers=Fingers(count=1, friction=0.5, max_force=100.0),
    )
    scaled = ScaledTask.of(task)
    best = Search(scaled, 1, 0.1).run(Budget(np.inf)).best
    if best.sequence is not None:
        polished(scaled, best.sequence, best.z, Budget(np.inf))
    mend(scaled, sequence_of(scaled, np.zeros((3, 1), dtype=np.int64)), np.array([0.5]), Budget(np.inf))


def _without_plan(
    task: ContactTask, scaled: ScaledTask, search: Search, outcome: Outcome, budget: Budget
) -> Plan:
    status: Status = "infeasible"
    bound, reason = np.inf, ""
    if outcome.limited:
        status, reason = "time_limit", "the budget was spent before a plan was found"
        bound = outcome.bound * scaled.cost_unit
    elif np.isfinite(outcome.bound):
        raise SolverFailed("some contact sequences could neither be solved nor ruled out numerically")
    else:
        reason = why_infeasible(task, scaled, search.phi.cost)
    return Plan(
        status=status,
        bound=bound,
        nodes=outcome.nodes,
        reason=reason,
        certificate=certificate_of(search, outcome.bound, budget),
        seconds=budget.spent,
    )


def _with_plan(task: ContactTask, scaled: ScaledTask, outcome: Outcome, z: Array, gap: float) -> Plan:
    assert outcome.best.sequence is not None
    plan = plan_at(task, scaled, outcome.best.sequence, z, status="feasible", nodes=outcome.nodes)
    bound = min(float(outcome.bound) * scaled.cost_unit, plan.objective)
    closed = plan.objective - bound <= max(gap * abs(plan.objective), NEGLIGIBLE * scaled.cost_unit) * (
        1 + 1e-9
    )
    verdict: dict[str, Any] = {"status": "optimal", "reason": ""}
    if not closed:
        spent = "the budget was spent before the gap closed"
        verdict = {"status": "feasible", "reason": spent if outcome.limited else STUCK}
    plan = replace(plan, bound=bound, **verdict)
    return replace(plan, stated=Stated(gap=plan.gap, asked=gap))
