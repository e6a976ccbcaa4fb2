"""Random small quadratic programs, and how far an answer misses the laws of optimality."""

import numpy as np

from expert.geometry.pose import Array

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
