"""Contact impulses: P_n >= 0 against the normal velocity, |P_t| <= mu P_n against the tangential one.

With y = A P + c: y_n >= 0, P_n >= 0, y_n P_n = 0; y_t = 0 where |P_t| < mu P_n, else P_t opposes y_t.
A few projected Gauss-Seidel sweeps guess the state of every contact; an active-set Newton method makes it exact.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from dlm.simulator.contact import CONTACT

OPEN, STICK, SLIP_PLUS, SLIP_MINUS = 0, 1, 2, 3
"""State of a contact: P = 0; y = 0; y_n = 0 and P_t = +mu P_n or -mu P_n."""
ROWS = np.array([0, 2, 1, 1])
"""Equations of a contact by state."""
SWEEPS = np.array([4, 8, 40, 200])
"""Before each attempt of Newton's method; nearly always the first one succeeds."""
NEWTON = 6


ROW = np.dtype([(name, "f8") for name in ("x", "y", "turn", "c", "P", "rhs", "saved", "inverse")])
"""Row of the problem: direction and lever (the contact Jacobian), c, impulse, and scratch for the linear system."""


class Problem(NamedTuple):
    """Contacts (n,) of CONTACT, whose `state` holds the active set, their rows (2 n,) of ROW, A, and B for scratch (2 n, 2 n).

    All may be longer: functions take the number n of contacts first.
    """

    contacts: np.ndarray
    rows: np.ndarray
    A: np.ndarray
    B: np.ndarray


@njit(cache=True, error_model="numpy")
def problem_for(size: int) -> Problem:
    """Memory for at most so many contacts."""
    return Problem(
        np.zeros(size, CONTACT),
        np.zeros(2 * size, ROW),
        np.zeros((2 * size, 2 * size)),
        np.zeros((2 * size, 2 * size)),
    )


@njit(cache=True, error_model="numpy")
def solve_contacts(n: int, problem: Problem) -> bool:
    """Solve for the impulses.  False where only the sweeps' answer was found."""
    rows = problem.rows
    for r in range(2 * n):
        rows[r].P = 0
    for sweeps in SWEEPS:
        sweep(n, problem, sweeps)
        for r in range(2 * n):
            rows[r].saved = rows[r].P
        if newton(n, problem):
            return True
        for r in range(2 * n):
            rows[r].P = rows[r].saved
    guess_states(n, problem)
    return False


@njit(cache=True, error_model="numpy", inline="always")
def sweep(n: int, problem: Problem, sweeps: int) -> None:
    """Projected Gauss-Seidel, contact by contact."""
    m, contacts, rows, A = 2 * n, problem.contacts, problem.rows, problem.A
    for r in range(m):
        rows[r].inverse = 1 / A[r, r]
    for _ in range(sweeps):
        for i in range(n):
            for r in (2 * i, 2 * i + 1):
                y = rows[r].c
                for s in range(m):
                    y += A[r, s] * rows[s].P
                p = rows[r].P - y * rows[r].inverse
                if r == 2 * i:
                    rows[r].P = max(p, 0.0)
                else:
                    limit = contacts[i].friction * rows[2 * i].P
                    rows[r].P = min(max(p, -limit), limit)


@njit(cache=True, error_model="numpy", inline="always")
def guess_states(n: int, problem: Problem) -> None:
    """Read the states off the impulses."""
    contacts, rows = problem.contacts, problem.rows
    for i in range(n):
        normal, tangential = rows[2 * i].P, rows[2 * i + 1].P
        limit = contacts[i].friction * normal
        if normal <= 0:
            contacts[i].state = OPEN
        elif tangential >= limit:
            contacts[i].state = SLIP_PLUS
        elif tangential <= -limit:
            contacts[i].state = SLIP_MINUS
        else:
            contacts[i].state = STICK


@njit(cache=True, error_model="numpy", inline="always")
def newton(n: int, problem: Problem) -> bool:
    """Solve the linear system of the guessed states and correct them until they agree with their solution."""
    rows = problem.rows
    guess_states(n, problem)
    for _ in range(NEWTON):
        size = reduced_system(n, problem, False)
        for r in range(size):
            rows[r].rhs = -rows[r].rhs
        if not solve_linear(problem.B, rows, size):
            return False
        expand(n, problem)
        if not _correct_states(n, problem):
            return True
    return False


@njit(cache=True, error_model="numpy", inline="always")
def reduced_system(n: int, problem: Problem, transposed: bool) -> int:
    """Rows and columns of the active set into B, its part of c into the right-hand sides; return the size.

    A closed contact has a normal row; a sticking one has a tangential row too.  The column of a slipping contact
    carries its friction: A_n +- mu A_t.
    """
    contacts, rows, A, B = problem.contacts, problem.rows, problem.A, problem.B
    row = 0
    for i in range(n):
        for part in range(ROWS[contacts[i].state]):
            r = 2 * i + part
            column = 0
            for j in range(n):
                state = contacts[j].state
                if state == OPEN:
                    continue
                mu = 0.0 if state == STICK else contacts[j].friction * (1 if state == SLIP_PLUS else -1)
                B[row, column] = A[r, 2 * j] + mu * A[r, 2 * j + 1]
                column += 1
                if state == STICK:
                    B[row, column] = A[r, 2 * j + 1]
                    column += 1
            rows[row].rhs = rows[r].c
            row += 1
    if transposed:
        for r in range(row):
            for s in range(r):
                B[r, s], B[s, r] = B[s, r], B[r, s]
    return row


@njit(cache=True, error_model="numpy", inline="always")
def expand(n: int, problem: Problem) -> None:
    """Impulses P from the reduced solution in the right-hand sides."""
    contacts, rows = problem.contacts, problem.rows
    row = 0
    for i in range(n):
        state = contacts[i].state
        if state == OPEN:
            rows[2 * i].P = rows[2 * i + 1].P = 0.0
            continue
        rows[2 * i].P = rows[row].rhs
        if state == STICK:
            rows[2 * i + 1].P = rows[row + 1].rhs
            row += 1
        elif state == SLIP_PLUS:
            rows[2 * i + 1].P = contacts[i].friction * rows[row].rhs
        else:
            rows[2 * i + 1].P = -contacts[i].friction * rows[row].rhs
        row += 1


@njit(cache=True, error_model="numpy", inline="always")
def _correct_states(n: int, problem: Problem) -> bool:
    """Flip the states that contradict the impulses; return whether any did."""
    m, contacts, rows = 2 * n, problem.contacts, problem.rows
    impulse, speed = 0.0, 0.0
    for r in range(m):
        impulse = max(impulse, abs(rows[r].P))
        speed = max(speed, abs(rows[r].c))
    impulse_tolerance, speed_tolerance = 1e-11 * impulse, 1e-11 * speed
    changed = False
    for i in range(n):
        state, normal, tangential = contacts[i].state, rows[2 * i].P, rows[2 * i + 1].P
        new = state
        if state == OPEN:
            if relative_velocity(n, problem, 2 * i) < -speed_tolerance:
                new = STICK
        elif normal < -impulse_tolerance:
            new = OPEN
        elif state == STICK:
            limit = contacts[i].friction * max(normal, 0.0) + impulse_tolerance
            if tangential > limit:
                new = SLIP_PLUS
            elif tangential < -limit:
                new = SLIP_MINUS
        elif contacts[i].friction > 0:
            slip = relative_velocity(n, problem, 2 * i + 1)
            if (state == SLIP_PLUS and slip > speed_tolerance) or (
                state == SLIP_MINUS and slip < -speed_tolerance
            ):
                new = STICK
        if new != state:
            contacts[i].state, changed = new, True
    return changed


@njit(cache=True, error_model="numpy", inline="always")
def relative_velocity(n: int, problem: Problem, r: int) -> float:
    """y = A P + c in row r."""
    y = problem.rows[r].c
    for s in range(2 * n):
        y += problem.A[r, s] * problem.rows[s].P
    return y


@njit(cache=True, error_model="numpy", inline="always")
def solve_linear(B: np.ndarray, rows: np.ndarray, size: int) -> bool:
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
            rows[k].rhs, rows[pivot].rhs = rows[pivot].rhs, rows[k].rhs
        for r in range(k + 1, size):
            factor = B[r, k] / B[k, k]
            if factor != 0:
                for s in range(k + 1, size):
                    B[r, s] -= factor * B[k, s]
                rows[r].rhs -= factor * rows[k].rhs
    for k in range(size - 1, -1, -1):
        for s in range(k + 1, size):
            rows[k].rhs -= B[k, s] * rows[s].rhs
        rows[k].rhs /= B[k, k]
    return True
