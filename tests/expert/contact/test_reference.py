"""Published verdicts and optima of sixteen tasks: the primitives of Thesis Fig. 3-6 and 3-8 and what they cannot do."""

import json
from pathlib import Path

import pytest

from expert.contact import solve
from expert.files import read_problem
from expert.problems.contact import ContactTask
from expert.verify.plan.check import check_plan

DATA = Path(__file__).parents[2] / "data" / "contact"
REFERENCE = json.loads((DATA / "reference.json").read_text())
GAP = 1e-3


def task_named(name: str) -> ContactTask:
    problem = read_problem(DATA / f"{name}.json")
    return problem.task


@pytest.mark.parametrize("name", [n for n, r in REFERENCE.items() if r["status"] == "optimal"])
def test_optimum_agrees_with_the_reference_within_both_gaps(name: str) -> None:
    task = task_named(name)
    plan = solve(task, gap=GAP)
    assert plan.status == "optimal"
    assert plan.objective <= REFERENCE[name]["objective"] * (1 + GAP)
    assert plan.bound <= REFERENCE[name]["objective"]
    assert plan.gap <= GAP
    assert check_plan(task, plan).verdict == "sound"


@pytest.mark.parametrize("name", [n for n, r in REFERENCE.items() if r["status"] == "infeasible"])
def test_verdict_agrees_where_the_motion_is_impossible(name: str) -> None:
    plan = solve(task_named(name))
    assert plan.status == "infeasible"
    assert plan.reason
