"""SCIP, HiGHS and Gurobi behind one form; each says what it proved and nothing more.  One thread each.

A time_limit is processor time (`expert.budget`) from the call on, with what it takes to hand the model over.
"""

import importlib
import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import highspy
import numpy as np
import pyscipopt
import scipy.sparse as sp
from highspy._core import _Highs  # highspy.Highs prints a banner before it can be silenced

from expert.budget import Budget
from expert.errors import InvalidProblem
from expert.geometry.pose import Array

Status = Literal["optimal", "feasible", "infeasible", "limit", "failed"]
Solver = Literal["scip", "highs", "gurobi"]
PATIENCE = 1.1
"""HiGHS may take so many times its limit in wall time, for each process that runs on a core."""


@dataclass(frozen=True, kw_only=True)
class StandardForm:
    """minimise x' P x / 2 + q' x  subject to  row_low <= A x <= row_high, low <= x <= high, x integral where asked."""

    P: sp.coo_array
    q: Array
    A: sp.csr_array
    row_low: Array
    row_high: Array
    low: Array
    high: Array
    integral: np.ndarray

    @property
    def is_linear(self) -> bool:
        """Whether the objective has no quadratic part."""
        return not np.any(self.P.data)


@dataclass(frozen=True, kw_only=True)
class Answer:
    """Status, incumbent (None without one), certified lower bound of the objective, nodes, the solver's own word."""

    status: Status
    x: Array | None
    bound: float
    nodes: int
    message: str


def backend(solver: Solver) -> Callable[..., Answer]:
    """The function (form, gap, time_limit) -> Answer of a solver.  Raises InvalidProblem if it is unknown or missing."""
    known = {"scip": scip, "highs": highs, "gurobi": gurobi}
    if solver not in known:
        raise InvalidProblem("solver", expected=" or ".join(known), got=repr(solver))
    return known[solver]


def scip(form: StandardForm, gap: float, time_limit: float) -> Answer:
    """Convex quadratic objective: one epigraph variable per square, which SCIP separates better than one cone."""
    budget, model = Budget(time_limit), pyscipopt.Model()
    model.hideOutput()
    model.setSeparating(
        pyscipopt.SCIP_PARAMSETTING.FAST
    )  # thorough rounding cuts cost most of the time and gain little
    x = [
        model.addVar(vtype="I" if i else "C", lb=_finite(a), ub=_finite(b))
        for i, a, b in zip(form.integral, form.low, form.high, strict=True)
    ]
    for i, (a, b) in enumerate(zip(form.row_low, form.row_high, strict=True)):
        entries = slice(form.A.indptr[i], form.A.indptr[i + 1])
        row = pyscipopt.quicksum(
            c * x[j] for c, j in zip(form.A.data[entries], form.A.indices[entries], strict=True)
        )
        model.addCons(row == b if a == b else row <= b)
    model.setObjective(
        _epigraphs(model, x, form.P) + pyscipopt.quicksum(c * v for c, v in zip(form.q, x, strict=True))
    )
    scip_limits(model, gap, budget.left)
    model.optimize()
    return scip_answer(model, x)


def scip_limits(model: pyscipopt.Model, gap: float, time_limit: float) -> None:
    """Stop at this gap or after this much processor time [s]: what is found must not depend on the machine's load."""
    model.setParams({"limits/gap": gap, "limits/time": min(time_limit, 1e20), "timing/clocktype": 1})


def scip_answer(model: pyscipopt.Model, x: list) -> Answer:
    """What a SCIP model says after optimisation about its variables x.  Raises KeyboardInterrupt if it was interrupted."""
    word, found = model.getStatus(), model.getNSols() > 0
    if word == "userinterrupt":
        raise KeyboardInterrupt
    limits = word.endswith("limit")
    status: Status = "failed"
    if word in ("optimal", "gaplimit"):
        status = "optimal"
    elif word == "infeasible":
        status = "infeasible"
    elif limits:
        status = "feasible" if found else "limit"
    best = model.getBestSol() if found else None
    point = None if best is None else np.array([best[v] for v in x])
    bound = model.getDualbound() if status != "failed" else -np.inf
    bound = bound if abs(bound) < model.infinity() else np.copysign(np.inf, bound)
    return Answer(status=status, x=point, bound=float(bound), nodes=int(model.getNTotalNodes()), message=word)


def _epigraphs(model: pyscipopt.Model, x: list, P: sp.coo_array) -> pyscipopt.Expr:
    """x' P x / 2 as a sum of epigraph variables, one per diagonal entry; cross terms make all of it one convex term."""
    entries = [(p, int(i), int(j)) for p, i, j in zip(P.data, P.row, P.col, strict=True) if p != 0]
    if any(i != j for _, i, j in entries):
        whole = model.addVar(lb=None)
        model.addCons(pyscipopt.quicksum(p / 2 * x[i] * x[j] for p, i, j in entries) <= whole)
        return whole
    total = pyscipopt.quicksum([])
    for p, i, _ in entries:
        square = model.addVar(lb=0)
        model.addCons(
            p / 2 * x[i] * x[i] <= square
        )  # in units of the objective: SCIP's tolerance is absolute
        total += square
    return total


def _finite(bound: float) -> float | None:
    return float(bound) if np.isfinite(bound) else None


def highs(form: StandardForm, gap: float, time_limit: float) -> Answer:
    """Linear objectives only.  Raises InvalidProblem for squares."""
    if not form.is_linear:
        raise InvalidProblem("solver", expected="scip or gurobi for a quadratic objective", got="highs")
    budget, model = Budget(time_limit), _Highs()
    is_mip = bool(form.integral.any())
    for option, value in {"output_flag": False, "mip_rel_gap": gap, "threads": 1}.items():
        model.setOptionValue(option, value)
    model.passModel(_highs_model(form))
    if np.isfinite(time_limit):
        _stop_when_over(model, budget)
    model.run()
    info, word = model.getInfo(), model.getModelStatus().name
    found = info.primal_solution_status == 2  # kSolutionStatusFeasible
    status: Status = "failed"
    if word == "kOptimal":
        status = "optimal"
    elif word == "kInfeasible":
        status = "infeasible"
    elif word in ("kTimeLimit", "kIterationLimit", "kSolutionLimit", "kInterrupt", "kMemoryLimit"):
        status = "feasible" if found and is_mip else "limit"
    point = np.array(model.getSolution().col_value) if status in ("optimal", "feasible") else None
    bound = -np.inf
    if is_mip and status != "failed":
        bound = info.mip_dual_bound
    elif status == "optimal":
        bound = info.objective_function_value
    bound = np.inf if status == "infeasible" else bound
    return Answer(status=status, x=point, bound=bound, nodes=max(int(info.mip_node_count), 0), message=word)


def _stop_when_over(model: _Highs, budget: Budget) -> None:
    """Interrupt it by our clock: its own limit is wall time, which depends on the machine's load.

    At the root of a tree it asks nobody for long, so that its own limit is set as well, as late as that load lets expect.
    """

    def stop(kind: object, message: str, seen: object, answer: Any, data: object) -> None:
        answer.user_interrupt = budget.over

    model.setCallback(stop, None)
    kinds = highspy.cb.HighsCallbackType
    for kind in (kinds.kCallbackMipInterrupt, kinds.kCallbackSimplexInterrupt, kinds.kCallbackIpmInterrupt):
        model.startCallback(kind)
    processes_per_core = os.getloadavg()[0] / (os.cpu_count() or 1)
    model.setOptionValue("time_limit", PATIENCE * max(processes_per_core, 1.0) * budget.left)


def _highs_model(form: StandardForm) -> highspy.HighsLp:
    lp = highspy.HighsLp()
    lp.num_row_, lp.num_col_ = form.A.shape
    lp.col_cost_, lp.col_lower_, lp.col_upper_ = form.q, form.low, form.high
    lp.row_lower_, lp.row_upper_ = form.row_low, form.row_high
    lp.a_matrix_.format_ = highspy.MatrixFormat.kRowwise
    lp.a_matrix_.start_, lp.a_matrix_.index_, lp.a_matrix_.value_ = (
        form.A.indptr,
        form.A.indices,
        form.A.data,
    )
    kinds = (highspy.HighsVarType.kContinuous, highspy.HighsVarType.kInteger)
    lp.integrality_ = [kinds[int(i)] for i in form.integral]
    return lp


def gurobi(form: StandardForm, gap: float, time_limit: float) -> Answer:
    """Raises InvalidProblem where gurobipy is not installed or has no licence for this size."""
    budget, grb = Budget(time_limit), _gurobipy()

    def stop(running: Any, where: int) -> None:
        if budget.over:
            running.terminate()

    try:
        with grb.Env(params={"OutputFlag": 0}) as env, grb.Model(env=env) as model:
            x = model.addMVar(
                len(form.q), lb=form.low, ub=form.high, vtype=np.where(form.integral, "I", "C").tolist()
            )
            equal = form.row_low == form.row_high
            model.addConstr(form.A[equal] @ x == form.row_high[equal])
            model.addConstr(form.A[~equal] @ x <= form.row_high[~equal])
            model.setObjective(x @ (0.5 * form.P.tocsr()) @ x + form.q @ x)
            for name, value in {
                "MIPGap": gap,
                "Threads": 1,
                "DualReductions": 0,
            }.items():
                model.setParam(name, value)
            model.optimize(stop)
            return _gurobi_answer(model, x, grb.GRB, budget)
    except grb.GurobiError as error:
        raise InvalidProblem("solver", expected="a Gurobi licence for this model", got=str(error)) from error


def _gurobi_answer(model: Any, x: Any, codes: Any, budget: Budget) -> Answer:
    if model.Status == codes.INTERRUPTED and not budget.over:
        raise KeyboardInterrupt
    found = model.SolCount > 0
    proved: dict[int, Status] = {codes.OPTIMAL: "optimal", codes.INFEASIBLE: "infeasible"}
    limits = (codes.INTERRUPTED, codes.NODE_LIMIT, codes.ITERATION_LIMIT, codes.MEM_LIMIT)
    status = proved.get(model.Status, "failed")
    if model.Status in limits:
        status = "feasible" if found else "limit"
    return Answer(
        status=status,
        x=x.X if found else None,
        bound=np.inf if status == "infeasible" else model.ObjBound if status != "failed" else -np.inf,
        nodes=int(model.NodeCount),
        message=f"Gurobi status {model.Status}",
    )


def _gurobipy() -> Any:
    try:
        return importlib.import_module("gurobipy")
    except ImportError as error:
        raise InvalidProblem(
            "solver",
            expected="an installed solver",
            got="gurobi without the package gurobipy",
            remedy="pip install gurobipy, or choose scip",
        ) from error
