"""All modes of a contact problem: to find a solution where nothing else does, or others than the one that was found."""

import numpy as np

from dlm.simulator.kernels import borrowing, compiled
from dlm.simulator.problem import Problem, correct_states, expand, reduced_system, solve_linear

MOST_CONTACTS = 4
"""Whose 4^n modes are tried for other solutions, with every step of a record."""
MOST_TO_SOLVE = 7
"""Whose 4^n modes are tried for a first solution, hardly ever."""
SAME = 1e-6
"""Impulses that differ by less, of the largest, are the same."""


@borrowing
def find_mode(n: int, problem: Problem) -> None:
    """Set the states of up to MOST_TO_SOLVE contacts to the first mode whose equations have a solution within the laws."""
    for mode in range(4**n if n <= MOST_TO_SOLVE else 0):
        _set_states(n, problem, mode)
        if _solves(n, problem):
            _set_states(n, problem, mode)
            return


@borrowing
def _set_states(n: int, problem: Problem, mode: int) -> None:
    for i in range(n):
        problem.contacts[i].state = mode // 4**i % 4


@compiled
def has_other_solutions(n: int, problem: Problem) -> bool:
    """Whether another mode has a solution that differs (with much friction one may: Painleve); impulses and states of the solution that was found stay."""
    contacts, rows, _, _ = problem
    impulses, states = rows["P"][: 2 * n].copy(), contacts["state"][:n].copy()
    size, other = np.abs(impulses).max(), False
    for mode in range(4**n):
        _set_states(n, problem, mode)
        if not other and _solves(n, problem):
            for r in range(2 * n):
                other |= abs(rows[r].P - impulses[r]) > SAME * max(size, abs(rows[r].P))
    for r in range(2 * n):
        rows[r].P = impulses[r]
    for i in range(n):
        contacts[i].state = states[i]
    return other


@borrowing
def _solves(n: int, problem: Problem) -> bool:
    """Whether the equations of the states have a solution that keeps signs and cones."""
    size = reduced_system(n, problem, False)
    for r in range(size):
        problem.rows[r].rhs = -problem.rows[r].rhs
    if not solve_linear(problem.B, problem.rows, size):
        return False
    expand(n, problem)
    return not correct_states(n, problem)
