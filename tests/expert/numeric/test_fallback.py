"""Clarabel behind the compiled solver: right where it answers, and what failures may not become."""

from typing import Any

import numpy as np
import pytest

from expert.numeric import fallback as libraries
from expert.numeric.fallback import FAILED, INFEASIBLE, SOLVED, fallback
from expert.numeric.qp import goldfarb_idnani, solve_qp
from tests.support.quadratic import optimality_gap, random_program


def test_the_fallback_solves_what_the_compiled_solver_gave_up() -> None:
    for seed in range(1, 30, 2):
        program = random_program(seed, feasible=True)
        assert goldfarb_idnani(*program, 0)[0] == FAILED
        status, x, u = solve_qp(*program, 0)
        assert status == SOLVED
        assert optimality_gap(program, x, u) < 1e-3 * (1 + np.abs(u).max())


def test_a_fallback_proves_infeasibility_as_well() -> None:
    proofs = 0
    for seed in range(40):
        H, g, A, b, equalities = random_program(seed, feasible=False)
        status, _, u = fallback(H, g, A, b, equalities)
        assert (status == INFEASIBLE) == (goldfarb_idnani(H, g, A, b, equalities, 400)[0] == INFEASIBLE)
        if status == INFEASIBLE:
            proofs += 1
            assert np.abs(A.T @ u).max() < 1e-6 * np.abs(u).max()
            assert b @ u > 0
    assert proofs > 10


def breaks_down(*_: Any) -> Any:
    raise RuntimeError("injected")


def test_when_all_solvers_fail_nothing_is_claimed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(libraries, "_clarabel", breaks_down)
    assert fallback(*random_program(1, feasible=False))[0] == FAILED
    assert solve_qp(*random_program(1, feasible=False), 0)[0] == FAILED


def test_an_answer_that_is_not_finite_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(libraries, "_clarabel", lambda H, g, A, b, e: (SOLVED, np.nan * g, b))
    assert fallback(*random_program(2, feasible=True))[0] == FAILED
