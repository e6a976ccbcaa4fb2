"""Contact impulses: a guess by projected Gauss-Seidel sweeps, made exact by Newton's method on the states of the contacts.

Where that fails, because friction is large, Lemke's method finds the states, or else the trial of all of them.
"""

import numpy as np

from dlm.simulator.kernels import borrowing, inlined
from dlm.simulator.lemke import lemke
from dlm.simulator.modes import find_mode
from dlm.simulator.problem import (
    OPEN,
    SLIP_MINUS,
    SLIP_PLUS,
    STICK,
    Problem,
    correct_states,
    expand,
    reduced_system,
    solve_linear,
)

SWEEPS = np.array([4, 8, 40])
"""Before each attempt of Newton's method; nearly always the first one succeeds."""
NEWTON = 6


@borrowing
def solve_contacts(n: int, problem: Problem) -> bool:
    """Solve for the impulses and states; False where rounding defeats every method, with the impulses of the sweeps."""
    rows = problem.rows
    for r in range(2 * n):
        rows[r].P = 0
    for attempt in range(len(SWEEPS) + 2):
        if attempt < len(SWEEPS):
            sweep(n, problem, SWEEPS[attempt])
            guess_states(n, problem)
            for r in range(2 * n):
                rows[r].saved = rows[r].P
        elif attempt == len(SWEEPS):
            lemke(n, problem)
        else:
            find_mode(n, problem)
        if settle(n, problem):
            return True
        for r in range(2 * n):
            rows[r].P = rows[r].saved
    return False


@inlined
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


@inlined
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


@borrowing
def settle(n: int, problem: Problem) -> bool:
    """Newton's method: solve the equations of the states and correct these until they agree with the solution."""
    rows = problem.rows
    for _ in range(NEWTON):
        size = reduced_system(n, problem, False)
        for r in range(size):
            rows[r].rhs = -rows[r].rhs
        if not solve_linear(problem.B, rows, size):
            return False
        expand(n, problem)
        if not correct_states(n, problem):
            return True
    return False
