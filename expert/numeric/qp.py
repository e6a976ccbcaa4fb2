"""Small dense quadratic programs: minimise x'Hx/2 + g'x subject to A x = b (first rows), A x >= b (the rest).

The fast path is the dual active-set method of Goldfarb and Idnani (1983), compiled.  Whatever it cannot settle goes to
Clarabel (`fallback`); only a certificate makes a program infeasible, and nothing at all makes a failure so.
"""

from typing import NamedTuple

import numpy as np
from numba import njit, objmode

from expert.geometry.pose import Array
from expert.numeric.fallback import FAILED, FEASIBILITY, INFEASIBLE, SOLVED, fallback
from expert.world.values import IntArray

compiled = njit(cache=True, error_model="numpy")
"""Decorator of all compiled code of the solver."""
inlined = njit(cache=True, error_model="numpy", inline="always")
"""Decorator of parts of compiled functions: written into their callers, for passing bundles of arrays takes time."""
BoolArray = np.ndarray[tuple[int, ...], np.dtype[np.bool_]]


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


class Active(NamedTuple):
    """State of the dual active-set method: with L the Cholesky factor of H, J spans L^-T and R is J' times the active rows.

    rows (n,): active constraints, equalities first; dual (n,): their multipliers; sign (m,): -1 where an equality is met from above;
    in_use (m,): rows that are active, or equalities.  filled (2,): active rows, those among them that are equalities.
    x (n,): minimiser on the active rows.
    """

    J: Array
    R: Array
    rows: IntArray
    dual: Array
    sign: Array
    in_use: BoolArray
    filled: IntArray
    x: Array


class Direction(NamedTuple):
    """For a new row: d = J'row, step z of x and r of the multipliers, each (n,)."""

    d: Array
    z: Array
    r: Array


@compiled
def goldfarb_idnani(
    H: Array, g: Array, A: Array, b: Array, equalities: int, iterations: int
) -> tuple[int, Array, Array]:
    """The dual active-set method; FAILED after `iterations` changes of the active set or when H is not definite."""
    n, m = g.size, b.size
    a = _start(H, g, m, equalities)
    if a.J[0, 0] == 0.0:
        return FAILED, a.x, np.zeros(m)
    way = Direction(np.zeros(n), np.zeros(n), np.zeros(n))
    for i in range(iterations):
        if i < equalities:
            p, s = i, A[i] @ a.x - b[i]
            a.sign[p] = -1.0 if s > 0 else 1.0
            s = -abs(s)
        else:
            p, s = _most_violated(A, b, a, equalities)
            if p < 0:
                _refine(a, A, b)
                return SOLVED, a.x, _multipliers(a, a.dual)
        status = _add(a, way, A[p], p, s, equalities)
        if status == INFEASIBLE:
            u = _multipliers(a, -way.r)
            u[p] = a.sign[p]
            return INFEASIBLE, a.x, u
        if status == FAILED:
            break
    return FAILED, a.x, np.zeros(m)


@inlined
def _start(H: Array, g: Array, rows: int, equalities: int) -> Active:
    """No active rows; x = -H^-1 g, the minimiser without constraints."""
    n = g.size
    J, x = _inverse_cholesky(H), np.zeros(n)  # rows j: columns of L^-T
    for j in range(n):
        s = 0.0
        for i in range(j + 1):
            s += J[j, i] * g[i]
        for i in range(j + 1):
            x[i] -= s * J[j, i]
    in_use = np.zeros(rows, np.bool_)
    in_use[:equalities] = True
    none = np.zeros(n, np.int64)
    return Active(J, np.zeros((n, n)), none, np.zeros(n), np.ones(rows), in_use, np.zeros(2, np.int64), x)


@inlined
def _add(a: Active, way: Direction, row: Array, p: int, s: float, equalities: int) -> int:
    """Make row p, violated by -s, active, dropping rows that block the way; INFEASIBLE: no drop makes room for it."""
    multiplier = 0.0
    while True:
        full, squared = _directions(a, way, row, a.sign[p])
        dependent = squared <= 1e-20 * full
        drop, t1 = _first_blocking(a, way.r)
        t2 = np.inf if dependent else -s / squared
        t = min(t1, t2)
        if t == np.inf:
            # an equality that the others imply is no contradiction
            return SOLVED if p < equalities and s >= -FEASIBILITY else INFEASIBLE
        for k in range(a.filled[0]):
            a.dual[k] -= t * way.r[k]
        multiplier += t
        if not dependent:
            for i in range(a.x.size):
                a.x[i] += t * way.z[i]
            s += t * squared
        if t2 <= t1:
            if a.filled[0] >= a.x.size:
                return FAILED
            _append(a, way.d, p, multiplier)
            if p < equalities:
                a.filled[1] = a.filled[0]
            return SOLVED
        a.in_use[a.rows[drop]] = False
        _remove(a, drop)


@inlined
def _multipliers(a: Active, dual: Array) -> Array:
    """Multipliers of all rows from those of the active ones."""
    u = np.zeros(a.sign.size)
    for k in range(a.filled[0]):
        u[a.rows[k]] = dual[k] * a.sign[a.rows[k]]
    return u


@inlined
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


@inlined
def _most_violated(A: Array, b: Array, a: Active, equalities: int) -> tuple[int, float]:
    worst, least = -1, -FEASIBILITY
    for i in range(equalities, b.size):
        if not a.in_use[i]:
            s = -b[i]
            for k in range(a.x.size):
                s += A[i, k] * a.x[k]
            if s < least:
                worst, least = i, s
    return worst, least


@inlined
def _directions(a: Active, way: Direction, row: Array, sign: float) -> tuple[float, float]:
    """Primal step z and dual step r for a new constraint; |J'n|^2 and its part outside the active set."""
    n, q = row.size, a.filled[0]
    d, z, r = way
    full = squared = 0.0
    z[:] = 0.0
    for j in range(n):
        s = 0.0
        for i in range(n):
            s += a.J[j, i] * row[i]
        d[j] = sign * s
        full += s * s
        if j >= q:
            squared += s * s
            for i in range(n):
                z[i] += d[j] * a.J[j, i]
    for i in range(q - 1, -1, -1):
        s = d[i]
        for j in range(i + 1, q):
            s -= a.R[i, j] * r[j]
        r[i] = s / a.R[i, i]
    return full, squared


@inlined
def _first_blocking(a: Active, r: Array) -> tuple[int, float]:
    drop, t1 = -1, np.inf
    for k in range(a.filled[1], a.filled[0]):
        if r[k] > 1e-14 and a.dual[k] / r[k] < t1:
            drop, t1 = k, max(a.dual[k], 0.0) / r[k]
    return drop, t1


@inlined
def _refine(a: Active, A: Array, b: Array) -> None:
    """One step of iterative refinement: the active constraints hold to rounding, not to the method's drift."""
    q, x = a.filled[0], a.x
    w = np.empty(q)
    for k in range(q):
        i = a.rows[k]
        w[k] = a.sign[i] * b[i]
        for j in range(x.size):
            w[k] -= a.sign[i] * A[i, j] * x[j]
        for j in range(k):
            w[k] -= a.R[j, k] * w[j]
        w[k] /= a.R[k, k]
    for k in range(q):
        for j in range(x.size):
            x[j] += w[k] * a.J[k, j]


@inlined
def _append(a: Active, d: Array, p: int, multiplier: float) -> None:
    """Rotate d into its first q + 1 entries, make them column q of R, and row p active."""
    J, q, n = a.J, a.filled[0], d.size
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
        a.R[i, q] = d[i]
    a.rows[q], a.dual[q], a.in_use[p] = p, multiplier, True
    a.filled[0] += 1


@inlined
def _remove(a: Active, drop: int) -> None:
    """Make one active row inactive again."""
    J, R, q = a.J, a.R, a.filled[0]
    n = a.x.size
    for j in range(drop + 1, q):
        a.rows[j - 1], a.dual[j - 1] = a.rows[j], a.dual[j]
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
    a.filled[0] -= 1
