"""Labels: the expert's plan for a task, held against the independent checker before anybody may learn from it."""

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from datasets.limits import Number, check_numbers
from expert.contact import solve
from expert.errors import SolverFailed
from expert.problems.contact import ContactTask, Plan
from expert.verify.plan.check import check_plan


@dataclass(frozen=True, kw_only=True)
class Labelling:
    """How hard the expert tries.  The budget counts nodes, never seconds, so that labels do not depend on the machine's load.

    gap: relative gap at which the branch-and-bound stops.  node_limit: nodes per attempt.
    """

    gap: Annotated[float, Number(above=0, most=0.99)] = 1e-3
    node_limit: Annotated[int, Number(whole=True, least=1)] = 2000

    def __post_init__(self) -> None:
        check_numbers(self, "labelling.")


@dataclass(frozen=True, kw_only=True)
class Label:
    """A plan that the checker finds sound, with the task that it solves (its least push is 0 where none could be kept)."""

    task: ContactTask
    plan: Plan


@dataclass(frozen=True, kw_only=True)
class Refusal:
    """Why a drawn task is left out.

    reason: infeasible (proved), budget (no plan within the node limit), solver_failed (no answer),
    unsound (a plan that the checker refutes: a defect of the solver), no_motion (a shape without such a motion),
    inexpressible (a plan that the mechanical parameters cannot carry).
    """

    reason: str
    detail: str


def label(task: ContactTask, labelling: Labelling) -> Label | Refusal:
    """Plan with the task's least push where there is such a plan, else with none.

    Pushing with at least some force keeps contacts alive in execution, but not every motion has a plan that does.
    """
    answer = _attempt(task, labelling)
    if isinstance(answer, Refusal) and answer.reason != "unsound" and task.robustness.min_normal_force > 0:
        return _attempt(replace(task, robustness=replace(task.robustness, min_normal_force=0.0)), labelling)
    return answer


def _attempt(task: ContactTask, labelling: Labelling) -> Label | Refusal:
    try:
        plan = solve(task, gap=labelling.gap, time_limit=np.inf, node_limit=labelling.node_limit)
    except SolverFailed as failure:
        return Refusal(reason="solver_failed", detail=str(failure))
    if plan.status == "infeasible":
        return Refusal(reason="infeasible", detail=plan.reason)
    if not plan.found:
        return Refusal(reason="budget", detail=f"no plan within {labelling.node_limit} nodes")
    report = check_plan(task, plan)
    if report.verdict != "sound":
        return Refusal(reason="unsound", detail="; ".join(map(str, report.violations)))
    return Label(task=task, plan=plan)
