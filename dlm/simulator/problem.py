"""The contact problem of a step: P_n >= 0 against the normal velocity, |P_t| <= mu P_n against the tangential one.

With y = A P + c: y_n >= 0, P_n >= 0, y_n P_n = 0; y_t = 0 where |P_t| < mu P_n, else P_t opposes y_t.
In a known state of every contact these are linear equations.
"""

from typing import NamedTuple

import numpy as np

from dlm.simulator.contact import CONTACT
from dlm.simulator.kernels import borrowing, compiled, inlined

OPEN, STICK, SLIP_PLUS, SLIP_MINUS = 0, 1, 2, 3
"""State of a contact: P = 0; y = 0; y_n = 0 and P_t = +mu P_n or -mu P_n."""
ROUNDING = 1e-11
"""Signs are not judged of impulses and velocities below this share of the largest ones."""
ROWS = np.array([0, 2, 1, 1])
"""Equations of a contact by state."""
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


@compiled
def problem_for(size: int) -> Problem:
    """Memory for at most so many contacts."""
    return Problem(
        np.zeros(size, CONTACT),
        np.zeros(2 * size, ROW),
        np.zeros((2 * size, 2 * size)),
        np.zeros((2 * size, 2 * size)),
    )


@inlined
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


@inlined
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


@inlined
def relative_velocity(n: int, problem: Problem, r: int) -> float:
    """y = A P + c in row r."""
    y = problem.rows[r].c
    for s in range(2 * n):
        y += problem.A[r, s] * problem.rows[s].P
    return y


@borrowing
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


@inlined
def correct_states(n: int, problem: Problem) -> bool:
    """Flip the states that contradict the impulses; return whether any did."""
    contacts, rows, A, _ = problem
    impulse, speed, mobility = 0.0, 0.0, 0.0
    for r in range(2 * n):
        impulse = max(impulse, abs(rows[r].P))
        speed = max(speed, abs(rows[r].c))
        mobility = max(mobility, A[r, r])
    impulse_tolerance = ROUNDING * impulse
    # Large impulses leave rounding in velocities that nearly cancel.
    speed_tolerance = ROUNDING * (speed + 0.01 * mobility * impulse)
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
