"""What an answer claims beyond a plan: that none is cheaper, by how much at most, or that there is none at all."""

from dataclasses import replace

import numpy as np

from expert.problems.contact import ContactTask, Plan
from expert.verify.plan.duality import cost_unit
from expert.verify.plan.force_balance import first_unbalanced_step
from expert.verify.plan.optimality import objection
from expert.verify.plan.report import Check, PlanReport

EFFORT = ("seconds", "nodes", "reason")
"""Fields of an answer that say how it was found: nothing here depends on them."""
NUMBERS = ("objective", "bound", "gap", "residual")
"""Fields of an answer that only a plan gives a meaning."""
ROUNDING = 1e-9
"""Of a gap that is computed again."""
NEGLIGIBLE = 1e-9
"""Costs are not told apart below this, in units of `cost_unit`."""


def with_claims(task: ContactTask, plan: Plan, report: PlanReport) -> PlanReport:
    """The report on a plan with what is said of its optimality: checked where there is a certificate, else claimed."""
    checks, reason = (*report.checks, *_gap(task, plan)), report.reason
    unproved = ("bound", "gap") if plan.certificate is None else ()
    if plan.certificate is not None:
        reason = objection(task, plan.certificate, plan.bound)
        checks = (*checks, Check.largest("proof", np.inf if reason else 0.0, 0.0, "objective", ()))
    doubtful = plan.status == "optimal" and (plan.certificate is None or plan.stated is None)
    verdict = "sound" if all(check.ok for check in checks) else "refuted"
    claimed = (*(("status",) if doubtful else ()), *unproved)
    return replace(report, verdict=verdict, checks=checks, reason=reason, claimed=claimed)  # type: ignore[arg-type]


def _gap(task: ContactTask, plan: Plan) -> tuple[Check, ...]:
    """The stated gap is that of objective and bound, and one that was asked for where the plan is called optimal."""
    if plan.stated is None:
        return ()
    misstated = abs(plan.gap - plan.stated.gap) if np.isfinite(plan.stated.gap) else 0.0
    allowed = max(plan.stated.asked * abs(plan.objective), NEGLIGIBLE * cost_unit(task))
    beyond = plan.objective - plan.bound - allowed if plan.status == "optimal" else 0.0
    scale = max(abs(plan.objective), NEGLIGIBLE * cost_unit(task))
    return (
        Check.largest("gap", misstated, ROUNDING, "objective", ()),
        Check.largest("optimal", beyond / scale, ROUNDING, "objective", ()),
    )


def check_bound(task: ContactTask, answer: Plan) -> PlanReport:
    """unknown, since there is no plan to judge; whether its bound holds is said all the same."""
    report = PlanReport(verdict="unknown", claim=answer.status, reason="no plan was found: nothing to check")
    if answer.certificate is None:
        return replace(report, claimed=NUMBERS)
    against = objection(task, answer.certificate, answer.bound)
    proved = "no plan was found; that none costs less than the bound is proved"
    claimed = tuple(name for name in NUMBERS if name != "bound")
    return replace(report, reason=against or proved, claimed=claimed)


def check_infeasible(task: ContactTask, answer: Plan) -> PlanReport:
    """sound where the certificate proves that there is no plan, or some step by itself admits no force balance; else unknown.

    refuted where the answer states numbers of a plan, of which it says that there is none.
    """
    report = PlanReport(verdict="unknown", claim="infeasible")
    gap = answer.stated.gap if answer.stated else np.nan
    stated = (answer.objective, answer.bound, gap, answer.residual)
    if wrong := [name for name, value in zip(NUMBERS, stated, strict=True) if np.isfinite(value)]:
        return replace(report, verdict="refuted", reason=f"{', '.join(wrong)} of a plan that does not exist")
    missing = "the file has no certificate"
    against = objection(task, answer.certificate, np.inf) if answer.certificate is not None else missing
    if not against:
        return replace(
            report, verdict="sound", reason="its certificate proves that no sequence of contacts works"
        )
    unused = ("certificate",) if answer.certificate is not None else ()
    step = first_unbalanced_step(task)
    if step is not None:
        reason = f"no finger placement balances the forces at step {step}"
        return replace(report, verdict="sound", reason=reason, claimed=unused)
    reason = f"every step by itself admits a force balance, and of sequences nothing is proved: {against}"
    return replace(report, reason=reason)
