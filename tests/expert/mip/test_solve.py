"""Results say what was proved: no incumbent is not infeasible, and numerical trouble is neither."""

import subprocess
import sys

import cvxpy as cp
import numpy as np
import pytest

from expert.errors import InvalidProblem
from expert.mip import backends
from expert.mip import solve as solving
from expert.mip.backends import Answer, StandardForm
from expert.mip.solve import solve


def knapsack(count: int, seed: int = 0) -> tuple[cp.Problem, cp.Variable]:
    """Quadratic knapsack-like assignment that takes a tree to solve."""
    rng = np.random.default_rng(seed)
    x = cp.Variable(count, boolean=True)
    A = rng.normal(size=(count // 2, count))
    return cp.Problem(
        cp.Minimize(cp.sum_squares(A @ x - rng.normal(size=count // 2))), [cp.sum(x) == count // 3]
    ), x


def brute_force(problem: cp.Problem, x: cp.Variable) -> float:
    best = np.inf
    for code in range(2**x.size):
        x.save_value(np.array([(code >> i) & 1 for i in range(x.size)], dtype=float))
        if all(c.violation() < 1e-9 for c in problem.constraints):
            best = min(best, float(problem.objective.value))
    return best


@pytest.mark.parametrize("seed", range(3))
def test_scip_finds_what_brute_force_finds(seed: int) -> None:
    problem, x = knapsack(9, seed)
    result = solve(problem, gap=1e-6)
    assert result.status == "optimal"
    assert result.bound <= result.value
    assert result.gap <= 1e-6
    found = x.value.copy()
    assert float(problem.objective.value) == pytest.approx(result.value)
    assert result.value == pytest.approx(brute_force(problem, x), rel=1e-6)
    assert set(np.round(found, 6)) <= {0.0, 1.0}


def test_constants_of_the_objective_enter_value_and_bound() -> None:
    x = cp.Variable(2, boolean=True)
    for solver in ("scip", "highs"):
        result = solve(cp.Problem(cp.Minimize(cp.sum(x) + 7), [cp.sum(x) >= 1]), solver=solver)
        assert (result.value, result.bound) == pytest.approx((8, 8))


def test_cross_terms_reach_scip_as_they_are() -> None:
    x = cp.Variable(2, integer=True)
    x_box = [x >= -5, x <= 5]
    Q = np.array([[2.0, 1.0], [1.0, 3.0]])
    result = solve(cp.Problem(cp.Minimize(cp.quad_form(x, Q) - 7 * x[0] - 9 * x[1]), x_box), gap=1e-9)
    values = {
        (a, b): 2 * a * a + 2 * a * b + 3 * b * b - 7 * a - 9 * b for a in range(-5, 6) for b in range(-5, 6)
    }
    assert result.value == pytest.approx(min(values.values()))
    assert values[tuple(np.round(x.value).astype(int))] == min(values.values())


@pytest.mark.parametrize("solver", ["scip", "highs"])
def test_infeasible_is_proved(solver: str) -> None:
    x = cp.Variable(3, boolean=True)
    result = solve(cp.Problem(cp.Minimize(cp.sum(x)), [cp.sum(x) == 1.5]), solver=solver)
    assert (result.status, result.found, result.bound, result.value) == ("infeasible", False, np.inf, np.inf)


@pytest.mark.parametrize("solver", ["scip", "highs"])
def test_no_time_and_no_incumbent_is_not_infeasible(solver: str) -> None:
    rng = np.random.default_rng(1)
    x = cp.Variable(60, integer=True, bounds=[0, 40])
    weights = rng.integers(1000, 9000, size=(4, 60))
    market_split = [weights @ x == weights @ rng.integers(0, 2, size=60) + 1]
    result = solve(cp.Problem(cp.Minimize(cp.sum(x)), market_split), solver=solver, time_limit=0.05)
    assert result.status == "limit"
    assert not result.found
    assert np.isnan(result.gap)


def test_out_of_time_the_incumbent_comes_with_a_valid_bound() -> None:
    problem, _ = knapsack(60)
    result = solve(problem, gap=0.0, time_limit=1.0)
    assert result.status == "feasible"
    assert result.bound < result.value
    assert result.value == pytest.approx(float(problem.objective.value))
    assert all(c.violation() < 1e-6 for c in problem.constraints)


def test_unbounded_is_no_proof_of_anything() -> None:
    x = cp.Variable()
    for solver in ("scip", "highs"):
        assert solve(cp.Problem(cp.Minimize(x), [x <= 1]), solver=solver).status == "failed"


def test_a_point_that_breaks_the_model_is_a_numerical_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    def wrong(form: StandardForm, gap: float, time_limit: float) -> Answer:
        honest = backends.scip(form, gap, time_limit)
        return Answer(status="optimal", x=honest.x + 0.01, bound=honest.bound, nodes=1, message="optimal")

    monkeypatch.setattr(solving, "backend", lambda solver: wrong)
    x = cp.Variable(2, bounds=[0, 1])
    result = solve(cp.Problem(cp.Minimize(cp.sum(x)), [cp.sum(x) >= 1]))
    assert result.status == "failed"
    assert "violates" in result.message
    assert not result.found


def test_wrong_solvers_are_refused_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    x = cp.Variable(2, boolean=True)
    problem = cp.Problem(cp.Minimize(cp.sum_squares(x)))
    with pytest.raises(InvalidProblem, match="scip or gurobi for a quadratic"):
        solve(problem, solver="highs")
    with pytest.raises(InvalidProblem, match="scip or highs or gurobi"):
        solve(problem, solver="cplex")  # type: ignore[arg-type]
    monkeypatch.setitem(sys.modules, "gurobipy", None)
    with pytest.raises(InvalidProblem, match="pip install gurobipy"):
        solve(problem, solver="gurobi")


def test_nothing_is_printed() -> None:
    """Asked of a process of its own: libraries print into a buffer that is emptied when the process ends."""
    program = """
import cvxpy as cp
from expert.mip.linear import LinearModel
from expert.mip.solve import solve
x = cp.Variable(2, boolean=True)
for solver in ("scip", "highs"):
    assert solve(cp.Problem(cp.Minimize(cp.sum(x)), [cp.sum(x) >= 1]), solver=solver).value == 1
model = LinearModel()
y = model.variables((2,), 0, 1)
model.add(y.sum(axis=0) >= 1)
model.minimise(y)
assert model.solve().status == "optimal"
"""
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert (ran.returncode, ran.stdout, ran.stderr) == (0, "", "")


@pytest.mark.gurobi
def test_gurobi_agrees_with_scip() -> None:
    pytest.importorskip("gurobipy")
    problem, _ = knapsack(9)
    assert solve(problem, solver="gurobi", gap=1e-6).value == pytest.approx(
        solve(problem, gap=1e-6).value, rel=1e-5
    )
