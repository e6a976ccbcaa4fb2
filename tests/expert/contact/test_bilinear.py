"""Two global solvers of the exact problem, written apart: branch and bound over modes, and SCIP on w = rho lambda_n."""

from pathlib import Path

import numpy as np
import pytest

from expert.contact import bilinear
from expert.contact import solve as solve_exactly
from expert.errors import SolverFailed
from expert.files import read_problem
from expert.mip.backends import Answer
from expert.problems.contact import ContactTask, Robustness
from expert.verify.plan.check import check_plan
from tests.support.random_tasks import floor_task, table_task

DATA = Path(__file__).parents[2] / "data" / "contact"
GAP = 1e-3
ROBUST = Robustness(
    cone_fraction=0.7, support_inset=0.3, min_normal_force=0.03, min_interval=2, free_clearance=0.005
)


def assert_agreement(task: ContactTask) -> None:
    """Same verdict, objectives within the gaps, neither bound above the other's plan, and both plans sound."""
    exact, scip = solve_exactly(task, gap=GAP), bilinear.solve(task, gap=GAP, time_limit=60.0)
    assert exact.status == scip.status
    if not exact.found:
        return
    assert exact.status == "optimal"
    assert exact.bound <= scip.objective + 1e-6 * abs(scip.objective)
    assert scip.bound <= exact.objective + 1e-6 * abs(exact.objective)
    for plan in (exact, scip):
        report = check_plan(task, plan)
        assert report.verdict == "sound", str(report)


@pytest.mark.parametrize(
    "name", ["sq_slide1", "sd_slide1", "pl_curve1", "sq_pivot1", "sd_pivot1", "tri_lift2"]
)
def test_reference_tasks(name: str) -> None:
    assert_agreement(read_problem(DATA / f"{name}.json").task)


@pytest.mark.parametrize("seed", range(3))
def test_one_finger_over_a_floor(seed: int) -> None:
    assert_agreement(floor_task(np.random.default_rng(seed), fingers=1, steps=4, robustness=ROBUST))


@pytest.mark.parametrize("seed", range(3))
def test_two_fingers_over_a_floor(seed: int) -> None:
    rng = np.random.default_rng(10 + seed)
    assert_agreement(floor_task(rng, facets=3, steps=2, margin=0.2 * (seed == 0)))


@pytest.mark.parametrize("seed", range(3))
def test_two_fingers_on_a_table(seed: int) -> None:
    assert_agreement(table_task(np.random.default_rng(seed), facets=3, steps=2))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["tri_pivot2", "sq_pivot2"])
def test_two_finger_primitives(name: str) -> None:
    assert_agreement(read_problem(DATA / f"{name}.json").task)


def test_out_of_time_is_not_infeasible() -> None:
    plan = bilinear.solve(read_problem(DATA / "sq_lift2.json").task, gap=GAP, time_limit=0.01)
    assert plan.status == "time_limit"
    assert not plan.found
    assert plan.bound < 2.5


def test_a_numerical_failure_is_raised_not_reported_as_infeasible(monkeypatch: pytest.MonkeyPatch) -> None:
    broken = Answer(status="failed", x=None, bound=-np.inf, nodes=0, message="LP trouble")
    monkeypatch.setattr(bilinear, "scip_answer", lambda model, x: broken)
    with pytest.raises(SolverFailed, match="LP trouble"):
        bilinear.solve(read_problem(DATA / "sq_slide1.json").task, gap=GAP, time_limit=60.0)


def test_nothing_is_printed(capfd: pytest.CaptureFixture[str]) -> None:
    bilinear.solve(read_problem(DATA / "sd_slide1.json").task, gap=GAP, time_limit=60.0)
    assert capfd.readouterr() == ("", "")
