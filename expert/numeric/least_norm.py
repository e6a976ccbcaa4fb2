"""A quadratic programme in three variables with few rows, by enumeration: compiled, exact, without allocation."""

import numpy as np
from numba import njit

EXACT = 1e-13
"""Violation of the rows that counts as none, over the length of the point where that is above 1."""


@njit(cache=True, error_model="numpy")
def least_norm(A: np.ndarray, b: np.ndarray, count: int, u: np.ndarray) -> bool:
    """The shortest u (3,) with A u >= b for the first `count` rows (rows of unit order); False where there is none.

    It is a combination with weights >= 0 of at most three rows that hold with equality: all triples, pairs and single
    rows are tried, and the candidate that breaks the others least is taken.
    """
    w = np.empty(3)
    u[:] = 0
    best = _violation(A, b, count, u)
    for rows in range(1, 4):
        if best <= EXACT:
            return True
        for i in range(count):
            for j in range(0 if rows > 1 else -1, i if rows > 1 else 0):
                for k in range(0 if rows > 2 else -1, j if rows > 2 else 0):
                    if not _on_rows(A, b, i, j, k, w):
                        continue
                    violation = _violation(A, b, count, w)
                    if violation < best:
                        best = violation
                        u[0], u[1], u[2] = w[0], w[1], w[2]
    return best <= EXACT * (1 + abs(u[0]) + abs(u[1]) + abs(u[2]))


@njit(cache=True, error_model="numpy")
def _violation(A: np.ndarray, b: np.ndarray, count: int, u: np.ndarray) -> float:
    worst = 0.0
    for k in range(count):
        worst = max(worst, b[k] - A[k, 0] * u[0] - A[k, 1] * u[1] - A[k, 2] * u[2])
    return worst


@njit(cache=True, error_model="numpy")
def _on_rows(A: np.ndarray, b: np.ndarray, i: int, j: int, k: int, w: np.ndarray) -> bool:
    """The shortest w on rows i, j, k (-1: no row) with equality; False where a weight is negative or rows depend."""
    p = A[i, 0] * A[i, 0] + A[i, 1] * A[i, 1] + A[i, 2] * A[i, 2]
    if j < 0:
        l = b[i] / p
        w[0], w[1], w[2] = l * A[i, 0], l * A[i, 1], l * A[i, 2]
        return l >= 0
    r = A[j, 0] * A[j, 0] + A[j, 1] * A[j, 1] + A[j, 2] * A[j, 2]
    o = A[i, 0] * A[j, 0] + A[i, 1] * A[j, 1] + A[i, 2] * A[j, 2]
    if k < 0:
        det = p * r - o * o
        if det <= 1e-14 * p * r:
            return False
        l, m = (r * b[i] - o * b[j]) / det, (p * b[j] - o * b[i]) / det
        for d in range(3):
            w[d] = l * A[i, d] + m * A[j, d]
        return l >= 0 and m >= 0
    # Cramer's rule for the point; its weights by the dual basis.
    c0 = A[j, 1] * A[k, 2] - A[j, 2] * A[k, 1]
    c1 = A[j, 2] * A[k, 0] - A[j, 0] * A[k, 2]
    c2 = A[j, 0] * A[k, 1] - A[j, 1] * A[k, 0]
    d0 = A[k, 1] * A[i, 2] - A[k, 2] * A[i, 1]
    d1 = A[k, 2] * A[i, 0] - A[k, 0] * A[i, 2]
    d2 = A[k, 0] * A[i, 1] - A[k, 1] * A[i, 0]
    e0 = A[i, 1] * A[j, 2] - A[i, 2] * A[j, 1]
    e1 = A[i, 2] * A[j, 0] - A[i, 0] * A[j, 2]
    e2 = A[i, 0] * A[j, 1] - A[i, 1] * A[j, 0]
    det = A[i, 0] * c0 + A[i, 1] * c1 + A[i, 2] * c2
    size = A[k, 0] * A[k, 0] + A[k, 1] * A[k, 1] + A[k, 2] * A[k, 2]
    if det * det <= 1e-18 * p * r * size:
        return False
    w[0] = (b[i] * c0 + b[j] * d0 + b[k] * e0) / det
    w[1] = (b[i] * c1 + b[j] * d1 + b[k] * e1) / det
    w[2] = (b[i] * c2 + b[j] * d2 + b[k] * e2) / det
    floor = -1e-12 * (abs(w[0]) + abs(w[1]) + abs(w[2]))
    l = (w[0] * c0 + w[1] * c1 + w[2] * c2) / det
    m = (w[0] * d0 + w[1] * d1 + w[2] * d2) / det
    n = (w[0] * e0 + w[1] * e1 + w[2] * e2) / det
    return l >= floor and m >= floor and n >= floor
