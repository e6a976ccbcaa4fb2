"""Solve a mixed-integer convex program written in cvxpy, and say exactly what is known afterwards."""

from dataclasses import dataclass
from typing import Any

import cvxpy as cp
import cvxpy.settings as keys
import numpy as np
import scipy.sparse as sp
from cvxpy.reductions.solution import Solution
from cvxpy.reductions.solvers.qp_solvers.qp_solver import QpSolver

from expert.budget import Budget
from expert.geometry.pose import Array
from expert.mip.backends import Answer, Solver, StandardForm, Status, backend

VIOLATION = 1e-4
"""An incumbent that violates its own model by more than this, relative to the row's size, is a numerical failure."""


@dataclass(frozen=True, kw_only=True)
class Result:
    """What a solver proved.

    status: optimal (within the gap asked for), feasible (budget spent; the incumbent stands in the variables),
    infeasible (proved), limit (budget spent, no incumbent yet: says nothing), failed (numerical trouble: says nothing).
    value, bound: objective of the incumbent and its certified lower bound, both inf where infeasible.  seconds: processor time with compilation.
    """

    status: Status
    value: float = np.inf
    bound: float = -np.inf
    seconds: float = 0.0
    nodes: int = 0
    message: str = ""

    @property
    def gap(self) -> float:
        """(value - bound) / |value|; nan without an incumbent."""
        return (self.value - self.bound) / max(abs(self.value), 1e-12) if self.found else np.nan

    @property
    def found(self) -> bool:
        """Whether the problem's variables hold a feasible point."""
        return self.status in ("optimal", "feasible")


def solve(
    problem: cp.Problem, *, solver: Solver = "scip", gap: float = 1e-3, time_limit: float = 60.0
) -> Result:
    """Minimise; the incumbent, if any, is left in the problem's variables.  Never prints.

    scip: linear or convex quadratic.  highs: linear.  gurobi: both, with a licence.  time_limit [s]: processor time with
    compilation.
    Raises KeyboardInterrupt when interrupted, InvalidProblem for a solver that is missing or does not fit.
    """
    budget, optimise = Budget(time_limit), backend(solver)
    data, chain, inverse = problem.get_problem_data(_Compiler(), canon_backend=cp.SCIPY_CANON_BACKEND)
    form = _standard_form(data)
    answer = optimise(form, gap, budget.left)
    status, message = _judge(form, answer)
    value, offset = np.inf, inverse[-1][keys.OFFSET]
    if status in ("optimal", "feasible"):
        problem.unpack_results(answer.x, chain, inverse)
        value = float(problem.objective.value)
    return Result(
        status=status,
        value=value,
        bound=min(float(answer.bound + offset), value),
        seconds=budget.spent,
        nodes=answer.nodes,
        message=message,
    )


def _judge(form: StandardForm, answer: Answer) -> tuple[Status, str]:
    """The solver's status, unless the point that it returned breaks its own model."""
    if answer.x is None:
        return answer.status, answer.message
    activity, size = form.A @ answer.x, 1 + abs(form.A) @ np.abs(answer.x)
    rows = np.maximum(form.row_low - activity, activity - form.row_high) / size
    box = np.maximum(form.low - answer.x, answer.x - form.high)
    fraction = np.abs(answer.x - np.round(answer.x))[form.integral]
    worst = max(part.max(initial=0.0) for part in (rows, box, fraction))
    if worst > VIOLATION:
        return "failed", f"{answer.message}; the incumbent violates the model by {worst:.1e}"
    return answer.status, answer.message


def _standard_form(data: dict[str, Any]) -> StandardForm:
    n = data["n_var"]
    low = np.full(n, -np.inf) if data[keys.LOWER_BOUNDS] is None else data[keys.LOWER_BOUNDS].astype(float)
    high = np.full(n, np.inf) if data[keys.UPPER_BOUNDS] is None else data[keys.UPPER_BOUNDS].astype(float)
    binary, integral = np.array(data[keys.BOOL_IDX], dtype=int), np.zeros(n, dtype=bool)
    low[binary], high[binary] = np.maximum(low[binary], 0), np.minimum(high[binary], 1)
    integral[binary] = integral[np.array(data[keys.INT_IDX], dtype=int)] = True
    return StandardForm(
        P=sp.coo_array(data[keys.P]),
        q=data[keys.Q],
        A=sp.csr_array(sp.vstack([data[keys.A], data[keys.F]])),
        row_low=np.concatenate([data[keys.B], np.full(data["n_ineq"], -np.inf)]),
        row_high=np.concatenate([data[keys.B], data[keys.G]]),
        low=low,
        high=high,
        integral=integral,
    )


class _Compiler(QpSolver):
    """Tells cvxpy to compile down to a mixed-integer quadratic program with bounds; the backends take it from there."""

    MIP_CAPABLE = True
    BOUNDED_VARIABLES = True

    def name(self) -> str:
        return "STANDARD_FORM"

    def import_solver(self) -> None:
        pass

    def cite(self, data: dict[str, Any]) -> str:
        return ""

    def solve_via_data(self, *args: object, **options: object) -> Array:
        raise NotImplementedError("use expert.mip.solve.solve")

    def invert(self, solution: Array, inverse_data: dict[str, Any]) -> Solution:
        """Put a point into the variables; what it is worth stands in the Result."""
        return Solution(keys.OPTIMAL, np.nan, {inverse_data[self.VAR_ID]: solution}, None, {})
