"""Lemke's method for contact problems: slow, and sure to find a solution.

    y_n = A_n P + c_n >= 0                     against  P_n >= 0
    y_+ = A_t P + c_t + slip >= 0              against  P_+ >= 0        P_t = P_+ - P_-
    y_- = -(A_t P + c_t) + slip >= 0           against  P_- >= 0
    room = mu P_n - P_+ - P_- >= 0             against  slip >= 0

A is positive definite (every contact has a compliance), so the matrix of this linear complementarity problem is copositive
and its homogeneous solutions are slips alone, on which the right-hand side is 0: the method ends in a solution, however
large the friction (Cottle, Pang, Stone, The Linear Complementarity Problem, 4.4.12; ties broken lexicographically).
So a step always has an answer; with much friction it may have several (Painleve), of which this is one.
"""

import numpy as np

from dlm.simulator.kernels import borrowing, compiled
from dlm.simulator.problem import OPEN, SLIP_MINUS, SLIP_PLUS, STICK, Problem

PIVOTS = 50
"""Per row, before the method gives up."""
TINY = 1e-11
"""Pivots that small are rounding [of entries of order 1]."""
TIE = 1e-9
"""As z0 vanishes, so do y_+ and y_- of every contact that sticks: z0 leaves first where it is among the first up to rounding."""


@compiled
def lemke(n: int, problem: Problem) -> bool:
    """Set the states of n contacts to those of a solution; False where rounding or PIVOTS stop the method."""
    table, basis = _tableau(n, problem), np.arange(4 * n)
    size = 4 * n
    entering, row = 2 * size, _lowest(table, size)
    for _ in range(PIVOTS * size):
        _pivot(table, row, entering)
        leaving, basis[row] = basis[row], entering
        if leaving == 2 * size:
            _read_states(n, problem, basis)
            return True
        entering = leaving + size if leaving < size else leaving - size  # the complement
        row = _blocking(table, basis, entering, size)
        if row < 0:
            return False
    return False


@compiled
def _tableau(n: int, problem: Problem) -> np.ndarray:
    """Rows y - M z - z0 = q, columns y (4 n), z (4 n), z0, q; impulses in units that make A's diagonal about 1."""
    contacts, rows, A, _ = problem
    size = 4 * n
    scale, speed = 0.0, 0.0
    for r in range(2 * n):
        scale, speed = max(scale, A[r, r]), max(speed, abs(rows[r].c))
    table = np.zeros((size, 2 * size + 2))
    for i in range(n):
        for j in range(n):
            for part, sign in ((0, 1.0), (1, 1.0), (2, -1.0)):
                r = 2 * i + min(part, 1)
                normal, tangential = sign * A[r, 2 * j] / scale, sign * A[r, 2 * j + 1] / scale
                line = table[4 * i + part, size + 4 * j :]
                line[0], line[1], line[2] = -normal, -tangential, tangential
        for part, sign in ((0, 1.0), (1, 1.0), (2, -1.0)):
            table[4 * i + part, -1] = sign * rows[2 * i + min(part, 1)].c / max(speed, 1e-300)
        line = table[4 * i + 3, size + 4 * i :]
        line[0], line[1], line[2] = -contacts[i].friction, 1.0, 1.0
        table[4 * i + 1, size + 4 * i + 3] = table[4 * i + 2, size + 4 * i + 3] = -1.0
    for r in range(size):
        table[r, r], table[r, -2] = 1.0, -1.0
    return table


@borrowing
def _lowest(table: np.ndarray, size: int) -> int:
    """The row that z0 must lift first; of equal ones the last, which is lexicographically the lowest."""
    row = 0
    for r in range(size):
        if table[r, -1] <= table[row, -1]:
            row = r
    return row


@compiled
def _pivot(table: np.ndarray, row: int, column: int) -> None:
    """Make a column a unit vector."""
    pivot = table[row]
    pivot /= pivot[column]
    for r in range(len(table)):
        if r != row and table[r, column] != 0:
            table[r] -= table[r, column] * pivot


@borrowing
def _blocking(table: np.ndarray, basis: np.ndarray, entering: int, size: int) -> int:
    """Row that reaches 0 first as a column enters, -1 if none does; z0's where it is among them, else by lexicographic order."""
    best = -1
    for r in range(size):
        if table[r, entering] <= TINY:
            continue
        if best < 0 or _before(table, r, best, entering, size):
            best = r
    for r in range(size):
        if best >= 0 and basis[r] == 2 * size and table[r, entering] > TINY:
            least = table[best, -1] / table[best, entering]
            if table[r, -1] / table[r, entering] <= least + TIE * max(1.0, abs(least)):
                return r
    return best


@borrowing
def _before(table: np.ndarray, r: int, s: int, entering: int, size: int) -> bool:
    """Whether row r over its pivot is lexicographically less than row s over its own: right-hand side, then the inverse basis."""
    a, b = table[r, entering], table[s, entering]
    difference = table[r, -1] / a - table[s, -1] / b
    k = 0
    while abs(difference) <= 1e-13 and k < size:
        difference = table[r, k] / a - table[s, k] / b
        k += 1
    return difference < 0


@compiled
def _read_states(n: int, problem: Problem, basis: np.ndarray) -> None:
    """States of the contacts from the variables that are not 0."""
    contacts, size = problem.contacts, 4 * n
    positive = np.zeros(size, np.bool_)
    for variable in basis:
        if size <= variable < 2 * size:
            positive[variable - size] = True
    for i in range(n):
        slips = positive[4 * i + 3]
        if not positive[4 * i]:
            contacts[i].state = OPEN
        elif not slips and contacts[i].friction > 0:
            contacts[i].state = STICK
        else:
            contacts[i].state = SLIP_MINUS if positive[4 * i + 2] else SLIP_PLUS
