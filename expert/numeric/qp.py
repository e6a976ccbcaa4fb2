"""Small dense quadratic programs: minimise x'Hx/2 + g'x subject to A x = b (first rows), A x >= b (the rest).

The fast path is the dual active-set method of Goldfarb and Idnani (1983), compiled.  Whatever it cannot settle goes to
DAQP, PIQP and Clarabel in turn; only a certificate makes a program infeasible, and nothing at all makes a failure so.
"""

import clarabel
import daqp
import numpy as np
import piqp
import scipy.sparse
from numba import njit, objmode

from expert.geometry.pose import Array
from expert.world.values import IntArray

compiled = njit(cache=True, error_model="numpy")
"""Decorator of all compiled code of the solver."""
SOLVED, INFEASIBLE, FAILED = 0, 1, 2
BoolArray = np.ndarray[tuple[int, ...], np.dtype[np.bool_]]

FEASIBILITY = 1e-10
"""Largest violation of a constraint, in the program's own (non-dimensional) units."""


@compiled
def solve_qp(
    H: Array, g: Array, A: Array, b: Array, equalities: int | np.int64, iterations: int
) -> tuple[int, Array, Array]:
    """Status, minimiser x and multipliers u (u >= 0 at inequalities; Hx + g = A'u).  H must be positive definite.

    INFEASIBLE comes with multipliers that prove it: A'u = 0 and b.u > 0.  A literal number of equalities should come as
    np.int64, or compiled callers each get a copy of their own.
    """
    status, x, u = goldfarb_idnani(H, g, A, b, int(equalities), iterations)
    if status == FAILED:
        with objmode(status="int64", x="float64[::1]", u="float64[::1]"):
            status, x, u = fallback(H, g, A, b, equalities)
    return status, x, u


@compiled
def goldfarb_idnani(
    H: Array, g: Array, A: Array, b: Array, equalities: int, iterations: int
) -> tuple[int, Array, Array]:
    """The dual active-set method; FAILED after `iterations` changes of the active set or when H is not definite."""
    n, m = g.size, b.size
    u = np.zeros(m)
    J = _inverse_cholesky(H)  # rows j: columns of L^-T
    x = np.zeros(n)
    if J[0, 0] == 0.0:
        return FAILED, x, u
    _steepest_start(J, g, x)
    R, d, r, z = np.zeros((n, n)), np.zeros(n), np.zeros(n), np.zeros(n)
    active, dual, flipped = np.zeros(n, np.int64), np.zeros(n), np.ones(m)
    in_use = np.zeros(m, np.bool_)
    q, fixed = 0, 0  # active constraints; those among them that are equalities
    for p in range(m):
        in_use[p] = p < equalities
    next_equality = 0
    for _ in range(iterations):
        if next_equality < equalities:
            p = next_equality
            next_equality += 1
            s = A[p] @ x - b[p]
            flipped[p] = -1.0 if s > 0 else 1.0
            s = -abs(s)
        else:
            p, s = _most_violated(A, b, x, in_use, equalities)
            if p < 0:
                _refine(J, R, A, b, active, flipped, x, q)
                for k in range(q):
                    u[active[k]] = dual[k] * flipped[active[k]]
                return SOLVED, x, u
        multiplier = 0.0
        while True:
            full, squared = _directions(J, R, A[p], flipped[p], q, d, z, r)
            dependent = squared <= 1e-20 * full
            drop, t1 = _first_blocking(dual, r, fixed, q)
            t2 = np.inf if dependent else -s / squared
            t = min(t1, t2)
            if t == np.inf:
                if p < equalities and s >= -FEASIBILITY:
                    break  # an equality that the others imply
                u[p] = flipped[p]
                for k in range(q):
                    u[active[k]] = -r[k] * flipped[active[k]]
                return INFEASIBLE, x, u
            for k in range(q):
                dual[k] -= t * r[k]
            multiplier += t
            if not dependent:
                for i in range(n):
                    x[i] += t * z[i]
                s += t * squared
            if t2 <= t1:
                if q >= n:
                    return FAILED, x, u
                _append(J, R, d, q, n)
                active[q], dual[q] = p, multiplier
                in_use[p] = True
                q += 1
                if p < equalities:
                    fixed = q
                break
            in_use[active[drop]] = False
            _remove(J, R, active, dual, drop, q, n)
            q -= 1
    return FAILED, x, u


@compiled
def _inverse_cholesky(H: Array) -> Array:
    """L^-1 with H = L L'; entry (0, 0) is zero if H is not positive definite."""
    n = H.shape[0]
    L, inverse = np.zeros((n, n)), np.zeros((n, n))
    for i in range(n):
        for j in range(i + 1):
            s = H[i, j]
            for k in range(j):
                s -= L[i, k] * L[j, k]
            if i == j:
                if s <= 0.0:
                    inverse[0, 0] = 0.0
                    return inverse
                L[i, i] = np.sqrt(s)
            else:
                L[i, j] = s / L[j, j]
    for j in range(n):
        inverse[j, j] = 1.0 / L[j, j]
        for i in range(j + 1, n):
            s = 0.0
            for k in range(j, i):
                s -= L[i, k] * inverse[k, j]
            inverse[i, j] = s / L[i, i]
    return inverse


@compiled
def _steepest_start(J: Array, g: Array, x: Array) -> None:
    """x = -H^-1 g, the minimiser without constraints."""
    n = g.size
    for j in range(n):
        s = 0.0
        for i in range(j + 1):
            s += J[j, i] * g[i]
        for i in range(j + 1):
            x[i] -= s * J[j, i]


@compiled
def _most_violated(A: Array, b: Array, x: Array, in_use: BoolArray, equalities: int) -> tuple[int, float]:
    worst, least = -1, -FEASIBILITY
    for i in range(equalities, b.size):
        if not in_use[i]:
            s = -b[i]
            for k in range(x.size):
                s += A[i, k] * x[k]
            if s < least:
                worst, least = i, s
    return worst, least


@compiled
def _directions(
    J: Array, R: Array, row: Array, sign: float, q: int, d: Array, z: Array, r: Array
) -> tuple[float, float]:
    """Primal step z and dual step r for a new constraint; |J'n|^2 and its part outside the active set."""
    n = row.size
    full = squared = 0.0
    z[:] = 0.0
    for j in range(n):
        s = 0.0
        for i in range(n):
            s += J[j, i] * row[i]
        d[j] = sign * s
        full += s * s
        if j >= q:
            squared += s * s
            for i in range(n):
                z[i] += d[j] * J[j, i]
    for i in range(q - 1, -1, -1):
        s = d[i]
        for j in range(i + 1, q):
            s -= R[i, j] * r[j]
        r[i] = s / R[i, i]
    return full, squared


@compiled
def _first_blocking(dual: Array, r: Array, fixed: int, q: int) -> tuple[int, float]:
    drop, t1 = -1, np.inf
    for k in range(fixed, q):
        if r[k] > 1e-14 and dual[k] / r[k] < t1:
            drop, t1 = k, max(dual[k], 0.0) / r[k]
    return drop, t1


@compiled
def _refine(
    J: Array, R: Array, A: Array, b: Array, active: IntArray, flipped: Array, x: Array, q: int
) -> None:
    """One step of iterative refinement: the active constraints hold to rounding, not to the method's drift."""
    w = np.empty(q)
    for k in range(q):
        i = active[k]
        w[k] = flipped[i] * b[i]
        for j in range(x.size):
            w[k] -= flipped[i] * A[i, j] * x[j]
        for j in range(k):
            w[k] -= R[j, k] * w[j]
        w[k] /= R[k, k]
    for k in range(q):
        for j in range(x.size):
            x[j] += w[k] * J[k, j]


@compiled
def _append(J: Array, R: Array, d: Array, q: int, n: int) -> None:
    """Rotate d into its first q + 1 entries and make them column q of R."""
    for j in range(n - 1, q, -1):
        if d[j] != 0.0:
            h = np.hypot(d[j - 1], d[j])
            c, s = d[j - 1] / h, d[j] / h
            d[j - 1] = h
            for i in range(n):
                v, w = J[j - 1, i], J[j, i]
                J[j - 1, i] = c * v + s * w
                J[j, i] = c * w - s * v
    for i in range(q + 1):
        R[i, q] = d[i]


@compiled
def _remove(J: Array, R: Array, active: IntArray, dual: Array, drop: int, q: int, n: int) -> None:
    for j in range(drop + 1, q):
        active[j - 1], dual[j - 1] = active[j], dual[j]
        for i in range(j + 1):
            R[i, j - 1] = R[i, j]
    for j in range(drop, q - 1):
        h = np.hypot(R[j, j], R[j + 1, j])
        if h > 0.0:
            c, s = R[j, j] / h, R[j + 1, j] / h
            for k in range(j, q - 1):
                v, w = R[j, k], R[j + 1, k]
                R[j, k] = c * v + s * w
                R[j + 1, k] = c * w - s * v
            for i in range(n):
                v, w = J[j, i], J[j + 1, i]
                J[j, i] = c * v + s * w
                J[j + 1, i] = c * w - s * v


def fallback(H: Array, g: Array, A: Array, b: Array, equalities: int | np.int64) -> tuple[int, Array, Array]:
    """DAQP, PIQP, Clarabel: the first that solves the program, or proves that nothing does."""
    for method in (_daqp, _piqp, _clarabel):
        try:
            status, x, u = method(H, g, A, b, int(equalities))
        except Exception:
            continue  # a solver that breaks down says nothing; the next one is asked
        if status != FAILED and np.isfinite(x).all() and np.isfinite(u).all():
            return status, np.ascontiguousarray(x, dtype=float), np.ascontiguousarray(u, dtype=float)
    return FAILED, np.zeros(g.size), np.zeros(b.size)


def _daqp(H: Array, g: Array, A: Array, b: Array, equalities: int) -> tuple[int, Array, Array]:
    upper = np.where(np.arange(b.size) < equalities, b, 1e30)
    sense = np.where(np.arange(b.size) < equalities, 5, 0).astype(np.int32)
    x, _, flag, info = daqp.solve(H, g, A, upper, b.copy(), sense, primal_tol=FEASIBILITY)
    # Flag -1 means infeasible, but comes without a proof, and was seen on programs that others solve.
    return SOLVED if flag == 1 else FAILED, np.asarray(x), -np.asarray(info["lam"])


def _piqp(H: Array, g: Array, A: Array, b: Array, equalities: int) -> tuple[int, Array, Array]:
    solver = piqp.DenseSolver()
    solver.settings.eps_abs = solver.settings.eps_rel = FEASIBILITY
    rows, e = A[equalities:], equalities
    solver.setup(H, g, A[:e], b[:e], rows, b[e:], np.full(len(rows), np.inf))
    if solver.solve() != piqp.PIQP_SOLVED:
        return FAILED, g, b
    z = solver.result
    return SOLVED, np.array(z.x), np.concatenate([-np.array(z.y), np.array(z.z_l) - np.array(z.z_u)])


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
