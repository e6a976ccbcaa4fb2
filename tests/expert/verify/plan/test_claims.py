"""What is said of a plan's optimality is proved again or refuted, and told apart from what nobody can check."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from expert.contact import solve
from expert.files import Problem, read_problem, solution_fields, solution_of
from expert.problems.contact import ContactTask, Plan
from expert.verify.plan.check import verify
from expert.verify.plan.claims import EFFORT, check_infeasible
from expert.verify.plan.report import PlanReport
from expert.world.motion import Trajectory
from tests.support.hand_plans import lifted_block, pushed_block, sliding_block

GALLERY = Path(__file__).resolve().parents[4] / "configs" / "problem" / "contact_trajectory"
NO_PLAN = Plan(status="infeasible")


def solved(name: str) -> tuple[Problem, dict[str, Any]]:
    problem = read_problem(GALLERY / f"{name}.yaml")
    answer = solve(problem.task, **problem.options)
    return problem, json.loads(json.dumps(solution_fields(problem, answer)))


@pytest.fixture(scope="module")
def pivot() -> dict[str, Any]:
    return solved("block_pivot_two_fingers")[1]


@pytest.fixture(scope="module")
def no_sequence() -> dict[str, Any]:
    return solved("tool_pivot_one_finger")[1]


def judged(file: dict[str, Any], **changes: Any) -> PlanReport:
    solution = solution_of({**file, **changes})
    return verify(solution.problem.task, solution.answer)


def without_certificate(file: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in file.items() if key != "certificate"}


def test_an_optimum_is_proved_again_from_its_certificate(pivot: dict[str, Any]) -> None:
    report = judged(pivot)
    assert report.verdict == "sound", str(report)
    assert report.claimed == EFFORT
    assert report.check("proof").ok


LIES: dict[str, tuple[str, Callable[[dict[str, Any]], dict[str, Any]]]] = {
    "a bound between what is proved and the cost": (
        "proof",
        lambda f: {"bound": 0.1 * f["bound"] + 0.9 * f["objective"], "gap": None},
    ),
    "the bound is the cost": ("proof", lambda f: {"bound": f["objective"], "gap": 0.0}),
    "a bound too low for its gap": ("gap", lambda f: {"bound": 0.5 * f["bound"]}),
    "optimal, with a bound that is too low": ("optimal", lambda f: {"bound": 0.5 * f["bound"], "gap": None}),
    "no gap at all": ("gap", lambda f: {"gap": 0.0}),
    "a larger gap": ("gap", lambda f: {"gap": f["gap"] + 1e-6}),
    "optimal at more than was asked for": (
        "optimal",
        lambda f: {
            "problem": {**f["problem"], "options": {**f["problem"]["options"], "gap": 0.5 * f["gap"]}}
        },
    ),
    "optimal without a bound": ("optimal", lambda f: {"bound": None, "gap": None}),
    "a cheaper plan": ("objective", lambda f: {"objective": f["bound"], "gap": 0.0}),
    "another certificate": ("proof", lambda f: {"certificate": {**f["certificate"], "sequences": []}}),
    "a certificate that is none": ("proof", lambda f: {"certificate": {"steps": [1], "paths": 3}}),
}


@pytest.mark.parametrize(("law", "lie"), LIES.values(), ids=LIES)
def test_lies_about_optimality_are_refuted(
    pivot: dict[str, Any], law: str, lie: Callable[[dict[str, Any]], dict[str, Any]]
) -> None:
    report = judged(pivot, **lie(pivot))
    assert report.verdict == "refuted"
    assert law in [violation.name for violation in report.violations], str(report)


def test_a_lower_bound_that_is_proved_makes_a_feasible_plan_sound(pivot: dict[str, Any]) -> None:
    report = judged(pivot, status="feasible", bound=0.5 * pivot["bound"], gap=None)
    assert report.verdict == "sound", str(report)


def test_without_a_certificate_optimality_is_claimed(pivot: dict[str, Any]) -> None:
    report = judged(without_certificate(pivot))
    assert report.verdict == "sound"
    assert set(report.claimed) == {"status", "bound", "gap", *EFFORT}


def test_that_no_sequence_of_contacts_works_is_proved_again(no_sequence: dict[str, Any]) -> None:
    report = judged(no_sequence)
    assert report.verdict == "sound", str(report)
    assert report.claimed == EFFORT


def test_without_a_certificate_no_sequence_is_unknown(no_sequence: dict[str, Any]) -> None:
    report = judged(without_certificate(no_sequence))
    assert report.verdict == "unknown"
    assert "no certificate" in report.reason


def test_a_certificate_of_a_bound_does_not_prove_that_there_is_no_plan(pivot: dict[str, Any]) -> None:
    nothing = dict.fromkeys(("objective", "bound", "gap", "residual"))
    report = judged(pivot, status="infeasible", **nothing)
    assert report.verdict == "unknown"


def test_numbers_of_a_plan_that_does_not_exist_are_refuted(no_sequence: dict[str, Any]) -> None:
    for name in ("objective", "bound", "gap", "residual"):
        report = judged(no_sequence, **{name: 0.5})
        assert report.verdict == "refuted"
        assert name in report.reason


def one_finger_cannot_lift() -> ContactTask:
    task, _ = lifted_block()
    return replace(task, fingers=replace(task.fingers, count=1))


def test_infeasibility_is_proved_without_a_certificate_where_one_step_suffices() -> None:
    report = check_infeasible(one_finger_cannot_lift(), NO_PLAN)
    assert report.verdict == "sound"
    assert "step 0" in report.reason


def test_a_certificate_that_the_proof_does_not_need_is_claimed() -> None:
    report = check_infeasible(one_finger_cannot_lift(), replace(NO_PLAN, certificate={"steps": "nonsense"}))
    assert report.verdict == "sound"
    assert report.claimed == ("certificate",)


@pytest.mark.parametrize("made", [sliding_block, lifted_block, pushed_block])
def test_a_feasible_task_is_never_proved_infeasible(made: Callable[[], tuple[ContactTask, Plan]]) -> None:
    task, _ = made()
    for certificate in (None, {}, solve(task).certificate):
        assert verify(task, replace(NO_PLAN, certificate=certificate)).verdict == "unknown"


@pytest.mark.parametrize(("height", "verdict"), [(0.1, "unknown"), (0.001, "sound")])
def test_the_proof_knows_that_fingers_do_not_fit_under_a_low_block(height: float, verdict: str) -> None:
    """One finger carries a block from below; not where the floor is 1 mm under it and 2 mm of clearance are asked for."""
    task = one_finger_cannot_lift()
    raised = Trajectory.of(task.trajectory.poses + [0.0, height, 0.0], task.trajectory.dt)
    report = check_infeasible(replace(task, trajectory=raised), NO_PLAN)
    assert report.verdict == verdict


def test_a_bound_without_a_plan_is_proved_or_not_but_no_verdict() -> None:
    task = read_problem(GALLERY / "transverse_rotation_two_fingers.yaml").task
    answer = solve(task, node_limit=1)
    assert answer.status == "time_limit"
    assert answer.bound > 0
    report = verify(task, answer)
    assert (report.verdict, "bound" in report.claimed) == ("unknown", False)
    assert "is proved" in report.reason
    higher = verify(task, replace(answer, bound=1e3 * answer.bound))
    assert higher.verdict == "unknown"
    assert "proved" not in higher.reason
    without = verify(task, replace(answer, certificate=None))
    assert "bound" in without.claimed


def test_stated_numbers_that_are_not_finite_are_no_bound() -> None:
    task, plan = lifted_block()
    report = verify(task, replace(plan, bound=-np.inf, status="feasible", certificate={}))
    assert report.verdict == "refuted"
    assert "no bound" in report.reason
