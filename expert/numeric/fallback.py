"""Quadratic programs that the compiled method gave up, by Clarabel's interior point method: slow, but of another kind."""

import clarabel
import numpy as np
import scipy.sparse

from expert.geometry.pose import Array

SOLVED, INFEASIBLE, FAILED = 0, 1, 2
FEASIBILITY = 1e-10
"""Largest violation of a constraint, in the program's own (non-dimensional) units."""


def fallback(H: Array, g: Array, A: Array, b: Array, equalities: int | np.int64) -> tuple[int, Array, Array]:
    """Status, minimiser and multipliers as in `expert.numeric.qp`; FAILED where the solver breaks down, which says nothing."""
    try:
        status, x, u = _clarabel(H, g, A, b, int(equalities))
    except Exception:
        status, x, u = FAILED, g, b
    if status == FAILED or not (np.isfinite(x).all() and np.isfinite(u).all()):
        return FAILED, np.zeros(g.size), np.zeros(b.size)
    return status, np.ascontiguousarray(x, dtype=float), np.ascontiguousarray(u, dtype=float)


def _clarabel(H: Array, g: Array, A: Array, b: Array, equalities: int) -> tuple[int, Array, Array]:
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = FEASIBILITY
    cones = [clarabel.ZeroConeT(equalities), clarabel.NonnegativeConeT(b.size - equalities)]
    sparse = scipy.sparse.csc_matrix
    answer = clarabel.DefaultSolver(
        sparse(np.triu(H)), g, sparse(-A), -np.asarray(b), cones, settings
    ).solve()
    claims = {clarabel.SolverStatus.Solved: SOLVED, clarabel.SolverStatus.PrimalInfeasible: INFEASIBLE}
    status = claims.get(answer.status, FAILED)
    return status, g if status == INFEASIBLE else np.array(answer.x), np.array(answer.z)
