"""The compiled quadratic-program solver against the laws of optimality; infeasibility comes with proofs."""

import numpy as np
import pytest

from expert.numeric.fallback import FAILED, INFEASIBLE, SOLVED
from expert.numeric.qp import goldfarb_idnani, solve_qp
from tests.support.quadratic import optimality_gap, random_program


@pytest.mark.parametrize("seed", range(60))
def test_solutions_are_optimal(seed: int) -> None:
    program = random_program(seed, feasible=True)
    status, x, u = solve_qp(*program, 400)
    assert status == SOLVED
    assert optimality_gap(program, x, u) < 1e-6


def test_infeasibility_comes_with_a_proof() -> None:
    proofs = 0
    for seed in range(80):
        H, g, A, b, equalities = random_program(seed, feasible=False)
        status, _, u = goldfarb_idnani(H, g, A, b, equalities, 400)
        if status == INFEASIBLE:
            proofs += 1
            assert np.abs(A.T @ u).max() < 1e-8 * np.abs(u).max()
            assert b @ u > 0
            assert (u[equalities:] >= -1e-12 * np.abs(u).max()).all()
    assert proofs > 20


def test_a_hessian_without_curvature_is_a_failure_and_not_an_answer() -> None:
    H, A = np.zeros((2, 2)), np.eye(2)
    assert goldfarb_idnani(H, np.ones(2), A, np.zeros(2), 0, 100)[0] == FAILED
