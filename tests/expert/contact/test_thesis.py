"""MIQP1 as a whole: a relaxation of the exact problem that states its own error."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from expert.contact import solve as solve_exactly
from expert.contact import thesis
from expert.errors import SolverFailed
from expert.files import read_problem
from expert.mip.solve import Result
from expert.problems.contact import ContactTask, Plan, Robustness
from expert.verify.plan.check import check_plan
from tests.support.random_tasks import floor_task, table_task

DATA = Path(__file__).parents[2] / "data" / "contact"
GAP = 1e-3


def reference(name: str) -> ContactTask:
    return read_problem(DATA / f"{name}.json").task


@pytest.mark.parametrize("name", ["sq_slide1", "sd_slide1", "pl_curve1"])
def test_one_finger_primitives_are_bounded_from_below(name: str) -> None:
    task = reference(name)
    plan, exact = thesis.solve(task, gap=GAP, time_limit=60.0), solve_exactly(task, gap=GAP)
    assert plan.status == exact.status == "optimal"
    assert plan.bound <= exact.objective * (1 + 1e-9)
    assert plan.objective <= exact.objective * (1 + 2 * GAP)
    assert plan.objective >= 0.8 * exact.objective


@pytest.mark.parametrize("name", ["sq_lift1", "pl_rot1", "tri_pivot1", "tri_lift2"])
def test_what_the_relaxation_refutes_is_infeasible(name: str) -> None:
    plan = thesis.solve(reference(name), gap=GAP, time_limit=60.0)
    assert plan.status == "infeasible"
    assert not plan.found
    assert plan.bound == np.inf
    assert "relaxation" in plan.reason


def envelope_error(plan: Plan, task: ContactTask) -> float:
    """Euler's residual over m g L, from positions and forces alone."""
    q = task.trajectory.poses
    torque = task.body.inertia * task.trajectory.accelerations[:, 2]
    arm = plan.positions - q[:, None, :2]
    torque -= (arm[..., 0] * plan.forces[..., 1] - arm[..., 1] * plan.forces[..., 0]).sum(axis=1)
    for c in plan.contact_forces:
        r = c.point - q[c.step, :2]
        torque[c.step] -= r[0] * c.force[1] - r[1] * c.force[0]
    return float(np.abs(torque).max() / (task.weight * task.body.size))


def test_a_plan_states_its_envelope_error_and_breaks_no_other_law() -> None:
    task = reference("sd_slide1")
    plan = thesis.solve(task, gap=GAP, time_limit=60.0)
    assert plan.residual == pytest.approx(envelope_error(plan, task), rel=1e-6)
    assert plan.residual > 1e-3  # the checker refutes it, and the plan says so itself
    assert [check.name for check in check_plan(task, plan).violations] == ["newton_euler"]
    assert "4 segments" in plan.reason


def test_more_segments_tighten_the_relaxation() -> None:
    task = reference("pl_curve1")
    exact = solve_exactly(task, gap=1e-4)
    plans = [thesis.solve(task, gap=1e-4, segments=m, time_limit=60.0) for m in (1, 4, 16)]
    bounds = [plan.bound for plan in plans]
    assert bounds[0] < bounds[1] < bounds[2] <= exact.objective * (1 + 1e-6)
    assert plans[2].residual < plans[0].residual
    assert bounds[2] == pytest.approx(exact.objective, rel=0.05)


@pytest.mark.slow
def test_coarse_envelopes_make_the_impossible_look_feasible() -> None:
    """Thesis Fig. 3-6e: one finger cannot pivot the tool at friction 0.1; envelopes of one segment say that it can."""
    task = reference("sd_pivot1")
    assert solve_exactly(task).status == "infeasible"
    coarse = thesis.solve(task, gap=GAP, time_limit=60.0, segments=1)
    assert coarse.found
    assert coarse.residual > 0.1
    assert check_plan(task, coarse).verdict == "refuted"


@pytest.mark.parametrize("seed", range(4))
def test_small_random_tasks_are_bounded_from_below(seed: int) -> None:
    rng = np.random.default_rng(seed)
    options = Robustness(cone_fraction=0.7, support_inset=0.3, min_normal_force=0.02, min_interval=2)
    task = (
        table_task(rng, steps=2, fingers=1, facets=3)
        if seed % 2
        else floor_task(rng, steps=3, fingers=1, margin=0.1 * (seed == 2), robustness=options)
    )
    plan, exact = thesis.solve(task, gap=GAP, time_limit=60.0), solve_exactly(task, gap=GAP)
    if plan.status == "infeasible":
        assert exact.status == "infeasible"
        return
    assert plan.status == "optimal"
    if exact.found:
        assert plan.bound <= exact.objective + 1e-6 * abs(exact.objective)
    report = check_plan(task, plan)
    assert {check.name for check in report.violations} <= {"newton_euler"}


def test_out_of_time_is_not_infeasible() -> None:
    plan = thesis.solve(reference("sq_pivot2"), gap=GAP, time_limit=0.01)
    assert plan.status == "time_limit"
    assert not plan.found
    assert plan.bound < 1.0


def test_a_numerical_failure_is_raised_not_reported_as_infeasible(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        thesis, "solve_program", lambda *args, **options: Result(status="failed", message="LP trouble")
    )
    with pytest.raises(SolverFailed, match="LP trouble"):
        thesis.solve(reference("sq_slide1"), gap=GAP, time_limit=60.0)


def test_the_cost_weights_are_those_asked_for() -> None:
    task = reference("sq_slide1")
    forces_alone = replace(task, cost=replace(task.cost, acceleration=0.0))
    twice = replace(task, cost=replace(task.cost, acceleration=0.0, force=2.0))
    once, double = (thesis.solve(t, gap=1e-6, time_limit=60.0) for t in (forces_alone, twice))
    assert double.objective == pytest.approx(2 * once.objective, rel=1e-4)
    assert once.objective == pytest.approx((once.forces**2).sum())
