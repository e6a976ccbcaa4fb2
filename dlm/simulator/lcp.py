"""Contact impulses: P_n >= 0 against the normal velocity, |P_t| <= mu P_n against the tangential one.

With y = A P + c: y_n >= 0, P_n >= 0, y_n P_n = 0; y_t = 0 where |P_t| < mu P_n, else P_t opposes y_t.
A few projected Gauss-Seidel sweeps guess the state of every contact; an active-set Newton method makes it exact.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

OPEN, STICK, SLIP_PLUS, SLIP_MINUS = 0, 1, 2, 3
"""State of a contact: P = 0; y = 0; y_n = 0 and P_t = +mu P_n or -mu P_n."""
ROWS = np.array([0, 2, 1, 1])
"""Equations of a contact by state."""
SWEEPS = 6
NEWTON = 12
FALLBACK_SWEEPS = 200


class Complementarity(NamedTuple):
    """A (m, m), c (m,), P (m,), states (m / 2,) and the reduced linear system of the active set."""

    A: np.ndarray
    c: np.ndarray
    P: np.ndarray
    state: np.ndarray
    B: np.ndarray
    rhs: np.ndarray
    saved: np.ndarray


@njit(cache=True)
def complementarity_for(contacts: int) -> Complementarity:
    """Empty work space."""
    m = 2 * contacts
    return Complementarity(
        np.zeros((m, m)),
        np.zeros(m),
        np.zeros(m),
        np.zeros(contacts, np.int64),
        np.zeros((m, m)),
        np.zeros(m),
        np.zeros(m),
    )


@njit(cache=True)
def solve_contacts(n: int, w: Complementarity, mu: np.ndarray) -> bool:
    """Solve for w.P with n contacts; w.state holds the active set.  False where only the sweeps' answer was found."""
    w.P[: 2 * n] = 0
    sweep(n, w, mu, SWEEPS)
    if newton(n, w, mu):
        return True
    w.P[: 2 * n] = 0
    sweep(n, w, mu, FALLBACK_SWEEPS)
    w.saved[: 2 * n] = w.P[: 2 * n]
    if newton(n, w, mu):
        return True
    w.P[: 2 * n] = w.saved[: 2 * n]
    guess_states(n, w, mu)
    return False


@njit(cache=True)
def sweep(n: int, w: Complementarity, mu: np.ndarray, sweeps: int) -> None:
    """Projected Gauss-Seidel, contact by contact."""
    m = 2 * n
    for _ in range(sweeps):
        for i in range(n):
            for r in (2 * i, 2 * i + 1):
                y = w.c[r]
                for s in range(m):
                    y += w.A[r, s] * w.P[s]
                p = w.P[r] - y / w.A[r, r]
                if r == 2 * i:
                    w.P[r] = max(p, 0.0)
                else:
                    limit = mu[i] * w.P[2 * i]
                    w.P[r] = min(max(p, -limit), limit)


@njit(cache=True)
def guess_states(n: int, w: Complementarity, mu: np.ndarray) -> None:
    """Read the states off the impulses."""
    for i in range(n):
        normal, tangential = w.P[2 * i], w.P[2 * i + 1]
        limit = mu[i] * normal
        if normal <= 0:
            w.state[i] = OPEN
        elif tangential >= limit:
            w.state[i] = SLIP_PLUS
        elif tangential <= -limit:
            w.state[i] = SLIP_MINUS
        else:
            w.state[i] = STICK


@njit(cache=True)
def newton(n: int, w: Complementarity, mu: np.ndarray) -> bool:
    """Solve the linear system of the guessed states and correct them until they agree with their solution."""
    guess_states(n, w, mu)
    for _ in range(NEWTON):
        size = reduced_system(n, w, mu, False)
        for r in range(size):
            w.rhs[r] = -w.rhs[r]
        if not solve_linear(w.B, w.rhs, size):
            return False
        expand(n, w, mu)
        if not _correct_states(n, w, mu):
            return True
    return False


@njit(cache=True)
def reduced_system(n: int, w: Complementarity, mu: np.ndarray, transposed: bool) -> int:
    """Rows and columns of the active set into w.B, its part of c into w.rhs; return the size.

    A closed contact has a normal row; a sticking one has a tangential row too.  The column of a slipping contact
    carries its friction: A_n +- mu A_t.
    """
    row = 0
    for i in range(n):
        for part in range(ROWS[w.state[i]]):
            r = 2 * i + part
            column = 0
            for j in range(n):
                state = w.state[j]
                if state == OPEN:
                    continue
                value = w.A[r, 2 * j]
                if state == STICK:
                    _put(w.B, row, column + 1, w.A[r, 2 * j + 1], transposed)
                elif state == SLIP_PLUS:
                    value += mu[j] * w.A[r, 2 * j + 1]
                else:
                    value -= mu[j] * w.A[r, 2 * j + 1]
                _put(w.B, row, column, value, transposed)
                column += 2 if state == STICK else 1
            w.rhs[row] = w.c[r]
            row += 1
    return row


@njit(cache=True, inline="always")
def _put(B: np.ndarray, r: int, s: int, value: float, transposed: bool) -> None:
    if transposed:
        B[s, r] = value
    else:
        B[r, s] = value


@njit(cache=True)
def expand(n: int, w: Complementarity, mu: np.ndarray) -> None:
    """Impulses P from the reduced solution in w.rhs."""
    row = 0
    for i in range(n):
        state = w.state[i]
        if state == OPEN:
            w.P[2 * i] = w.P[2 * i + 1] = 0.0
            continue
        w.P[2 * i] = w.rhs[row]
        if state == STICK:
            w.P[2 * i + 1] = w.rhs[row + 1]
            row += 1
        elif state == SLIP_PLUS:
            w.P[2 * i + 1] = mu[i] * w.rhs[row]
        else:
            w.P[2 * i + 1] = -mu[i] * w.rhs[row]
        row += 1


@njit(cache=True)
def _correct_states(n: int, w: Complementarity, mu: np.ndarray) -> bool:
    """Flip the states that contradict w.P; return whether any did."""
    m = 2 * n
    impulse, speed = 0.0, 0.0
    for r in range(m):
        impulse = max(impulse, abs(w.P[r]))
        speed = max(speed, abs(w.c[r]))
    impulse_tolerance, speed_tolerance = 1e-11 * impulse, 1e-11 * speed
    changed = False
    for i in range(n):
        state, normal, tangential = w.state[i], w.P[2 * i], w.P[2 * i + 1]
        new = state
        if state == OPEN:
            if _velocity(w, 2 * i, m) < -speed_tolerance:
                new = STICK
        elif normal < -impulse_tolerance:
            new = OPEN
        elif state == STICK:
            limit = mu[i] * max(normal, 0.0) + impulse_tolerance
            if tangential > limit:
                new = SLIP_PLUS
            elif tangential < -limit:
                new = SLIP_MINUS
        elif mu[i] > 0:
            slip = _velocity(w, 2 * i + 1, m)
            if (state == SLIP_PLUS and slip > speed_tolerance) or (
                state == SLIP_MINUS and slip < -speed_tolerance
            ):
                new = STICK
        if new != state:
            w.state[i], changed = new, True
    return changed


@njit(cache=True)
def _velocity(w: Complementarity, r: int, m: int) -> float:
    y = w.c[r]
    for s in range(m):
        y += w.A[r, s] * w.P[s]
    return y


@njit(cache=True)
def solve_linear(B: np.ndarray, x: np.ndarray, size: int) -> bool:
    """Gaussian elimination with partial pivoting, in place; False for a singular matrix."""
    for k in range(size):
        pivot = k
        for r in range(k + 1, size):
            if abs(B[r, k]) > abs(B[pivot, k]):
                pivot = r
        if not abs(B[pivot, k]) > 0 or not np.isfinite(B[pivot, k]):
            return False
        if pivot != k:
            for s in range(k, size):
                B[k, s], B[pivot, s] = B[pivot, s], B[k, s]
            x[k], x[pivot] = x[pivot], x[k]
        for r in range(k + 1, size):
            factor = B[r, k] / B[k, k]
            if factor != 0:
                for s in range(k + 1, size):
                    B[r, s] -= factor * B[k, s]
                x[r] -= factor * x[k]
    for k in range(size - 1, -1, -1):
        for s in range(k + 1, size):
            x[k] -= B[k, s] * x[s]
        x[k] /= B[k, k]
    return True
