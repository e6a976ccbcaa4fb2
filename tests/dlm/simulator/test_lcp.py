"""The contact problem against its own definition, and against every active set there is."""

import itertools

import numpy as np
import pytest

from dlm.simulator.lcp import (
    OPEN,
    ROW,
    SLIP_MINUS,
    SLIP_PLUS,
    STICK,
    problem_for,
    solve_contacts,
    solve_linear,
)


def random_problem(rng, n, friction):
    """A positive definite, c mostly closing."""
    J = rng.normal(size=(2 * n, 3))
    A = J @ J.T + np.diag(rng.uniform(0.01, 1, 2 * n))
    return A, rng.normal(-0.5, 1, 2 * n), np.full(n, friction)


def solve(A, c, mu):
    n = len(mu)
    problem = problem_for(n)
    problem.contacts["friction"], problem.rows["c"], problem.A[:] = mu, c, A
    exact = solve_contacts(n, problem)
    return problem.rows["P"].copy(), problem.contacts["state"].copy(), exact


def violation(A, c, mu, P):
    """Largest violation of signs, cones, complementarity and of friction opposing slip."""
    y = A @ P + c
    normal, tangential, y_n, y_t = P[::2], P[1::2], y[::2], y[1::2]
    limit = mu * normal
    parts = [
        -normal,
        -y_n,
        np.abs(normal * y_n),
        np.abs(tangential) - limit,
        np.abs((limit - tangential) * np.minimum(y_t, 0)),
        np.abs((limit + tangential) * np.maximum(y_t, 0)),
    ]
    return max(float(np.max(p)) for p in parts)


def solutions(A, c, mu):
    """Impulses of every active set that solves the problem, by trying all of them."""
    found = []
    for states in itertools.product((OPEN, STICK, SLIP_PLUS, SLIP_MINUS), repeat=len(mu)):
        columns, rows = [], []
        for i, state in enumerate(states):
            normal, tangent = np.eye(len(c))[2 * i], np.eye(len(c))[2 * i + 1]
            if state == STICK:
                columns += [normal, tangent]
                rows += [2 * i, 2 * i + 1]
            elif state != OPEN:
                columns.append(normal + (mu[i] if state == SLIP_PLUS else -mu[i]) * tangent)
                rows.append(2 * i)
        P = np.zeros(len(c))
        if columns:
            V = np.array(columns).T
            P = V @ np.linalg.solve((A @ V)[rows], -c[rows])
        if violation(A, c, mu, P) < 1e-9:
            found.append(P)
    return found


@pytest.mark.parametrize("n", [1, 2, 3])
def test_the_solution_is_among_those_of_all_active_sets(n):
    rng = np.random.default_rng(n)
    for _ in range(60):
        A, c, mu = random_problem(rng, n, rng.uniform(0, 0.8))
        P, _, exact = solve(A, c, mu)
        assert exact
        assert min(np.abs(P - Q).max() for Q in solutions(A, c, mu)) < 1e-9


def test_larger_problems_keep_signs_cones_and_complementarity():
    rng = np.random.default_rng(0)
    exact = 0
    for _ in range(300):
        A, c, mu = random_problem(rng, 6, 0.5)
        P, _, solved = solve(A, c, mu)
        exact += solved
        assert (P[::2] >= -1e-12).all()
        assert (np.abs(P[1::2]) <= mu * P[::2] + 1e-9).all()
        assert not solved or violation(A, c, mu, P) < 1e-8
    assert exact >= 297


def test_without_friction_no_tangential_impulse():
    A, c, _ = random_problem(np.random.default_rng(3), 4, 0)
    P, _, exact = solve(A, c, np.zeros(4))
    assert exact
    assert not P[1::2].any()


def test_linear_solver_agrees_with_lapack_and_refuses_singular_matrices():
    rng = np.random.default_rng(1)
    B, x = rng.normal(size=(7, 7)), rng.normal(size=7)
    rows = np.zeros(7, ROW)
    rows["rhs"] = B @ x
    assert solve_linear(B.copy(), rows, 7)
    np.testing.assert_allclose(rows["rhs"], x, rtol=1e-9)
    assert not solve_linear(np.zeros((2, 2)), rows, 2)
