"""The contact problem against its own definition, and against every solution there is."""

import numpy as np
import pytest

from dlm.simulator.lcp import settle, solve_contacts
from dlm.simulator.lemke import lemke
from dlm.simulator.modes import find_mode, has_other_solutions
from dlm.simulator.problem import ROW, Problem, problem_for, solve_linear
from tests.support.contact_modes import ContactProblem


def random_problem(rng: np.random.Generator, n: int, friction: float) -> ContactProblem:
    """Contacts of one planar body, more of them than it has freedoms, mostly closing."""
    J = rng.normal(size=(2 * n, 3))
    A = J @ J.T
    A += 1e-4 * np.diag(np.diag(A))
    return ContactProblem(A.reshape(n, 2, n, 2), rng.normal(-0.5, 1, (n, 2)), np.full(n, friction))


def memory(problem: ContactProblem) -> Problem:
    n = len(problem.mu)
    out = problem_for(n)
    out.contacts["friction"], out.rows["c"] = problem.mu, problem.c.ravel()
    out.A[:] = problem.A.reshape(2 * n, 2 * n)
    return out


def impulses(problem: Problem) -> np.ndarray:
    return problem.rows["P"].reshape(-1, 2).copy()


def by_lemke(n: int, problem: Problem) -> bool:
    return lemke(n, problem) and settle(n, problem)


def by_trial(n: int, problem: Problem) -> bool:
    find_mode(n, problem)
    return settle(n, problem)


@pytest.mark.parametrize("method", [solve_contacts, by_lemke, by_trial])
@pytest.mark.parametrize("n", [1, 2, 3])
def test_every_method_finds_one_of_all_solutions(method, n):
    rng = np.random.default_rng(n)
    for _ in range(40):
        problem = random_problem(rng, n, rng.uniform(0, 3))
        work = memory(problem)
        assert method(n, work)
        found = problem.solutions()
        assert min(np.abs(impulses(work) - Q).max() / np.abs(Q).max(initial=1e-9) for Q in found) < 1e-6


@pytest.mark.parametrize("friction", [0.5, 2.0])
def test_larger_problems_are_solved_too(friction):
    rng = np.random.default_rng(0)
    for _ in range(200):
        problem = random_problem(rng, 6, friction)
        work = memory(problem)
        assert solve_contacts(6, work)
        assert problem.violation(impulses(work)) < 1e-8


def test_other_solutions_are_seen_where_there_are_some_and_the_one_found_stays():
    rng = np.random.default_rng(5)
    seen = {True: 0, False: 0}
    for _ in range(150):
        problem = random_problem(rng, 2, rng.uniform(0, 3))
        work = memory(problem)
        assert solve_contacts(2, work)
        before = impulses(work)
        several = has_other_solutions(2, work)
        assert several == (len(problem.solutions()) > 1)
        np.testing.assert_array_equal(impulses(work), before)
        seen[several] += 1
    assert min(seen.values()) > 3


def test_without_friction_no_tangential_impulse():
    problem = random_problem(np.random.default_rng(3), 4, 0)
    work = memory(problem)
    assert solve_contacts(4, work)
    assert not impulses(work)[:, 1].any()


def test_linear_solver_agrees_with_lapack_and_refuses_singular_matrices():
    rng = np.random.default_rng(1)
    B, x = rng.normal(size=(7, 7)), rng.normal(size=7)
    rows = np.zeros(7, ROW)
    rows["rhs"] = B @ x
    assert solve_linear(B.copy(), rows, 7)
    np.testing.assert_allclose(rows["rhs"], x, rtol=1e-9)
    assert not solve_linear(np.zeros((2, 2)), rows, 2)
