"""The compiled quadratic-program solver against the laws of optimality, its fallbacks, and what failures may not become."""

from typing import Any

import numpy as np
import pytest

from expert.geometry.pose import Array
from expert.numeric import qp
from expert.numeric.qp import FAILED, INFEASIBLE, SOLVED, fallback, goldfarb_idnani, solve_qp

Program = tuple[Array, Array, Array, Array, int]


def random_program(seed: int, *, feasible: bool) -> Program:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 14))
    equalities = int(rng.integers(0, min(n, 4)))
    m = equalities + int(rng.integers(1, 25))
    half = rng.normal(size=(n, n))
    H = half @ half.T + 1e-4 * np.eye(n) if seed % 2 else np.diag(np.where(rng.random(n) < 0.5, 1e-7, 1.0))
    A = rng.normal(size=(m, n))
    slack = np.where(np.arange(m) < equalities, 0.0, rng.random(m))
    b = A @ rng.normal(size=n) - slack if feasible else rng.normal(size=m) + 1.0
    return H, rng.normal(size=n) * (seed % 3), A, b, equalities


def optimality_gap(program: Program, x: Array, u: Array) -> float:
    """Largest violation of the Karush-Kuhn-Tucker conditions."""
    H, g, A, b, equalities = program
    s = A @ x - b
    return max(
        np.abs(H @ x + g - A.T @ u).max(),
        np.abs(s[:equalities]).max(initial=0.0),
        -s[equalities:].min(initial=0.0),
        -u[equalities:].min(initial=0.0),
        np.abs(u[equalities:] * s[equalities:]).max(initial=0.0),
    )


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


@pytest.mark.parametrize("name", ["_daqp", "_piqp", "_clarabel"])
def test_every_fallback_solves_what_the_compiled_solver_gave_up(name: str, monkeypatch: Any) -> None:
    for other in {"_daqp", "_piqp", "_clarabel"} - {name}:
        monkeypatch.setattr(qp, other, breaks_down)
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


def test_when_all_solvers_fail_nothing_is_claimed(monkeypatch: Any) -> None:
    for name in ("_daqp", "_piqp", "_clarabel"):
        monkeypatch.setattr(qp, name, breaks_down)
    assert fallback(*random_program(1, feasible=False))[0] == FAILED
    assert solve_qp(*random_program(1, feasible=False), 0)[0] == FAILED


@pytest.mark.parametrize("flag", [-6, -5, -4, -3, -2, -1, 0, 2])
def test_no_exit_flag_of_daqp_is_a_proof(flag: int, monkeypatch: Any) -> None:
    def answer(H: Array, g: Array, A: Array, b: Array, *_: Any, **__: Any) -> tuple:
        return g, 0.0, flag, {"lam": np.zeros(len(b))}

    monkeypatch.setattr(qp.daqp, "solve", answer)
    assert qp._daqp(*random_program(2, feasible=True))[0] == FAILED


def test_a_hessian_without_curvature_is_a_failure_and_not_an_answer() -> None:
    H, A = np.zeros((2, 2)), np.eye(2)
    assert goldfarb_idnani(H, np.ones(2), A, np.zeros(2), 0, 100)[0] == FAILED
