"""Least acceleration of finger paths among convex conditions at each knot (cost of MIQP1, Thesis 5.2.5)."""

from collections.abc import Sequence

import numpy as np

from expert.errors import SolverFailed
from expert.geometry.pose import Array
from expert.grasping.rows import Rows
from expert.numeric.qp import INFEASIBLE, SOLVED, solve_qp

SPEED = 1e-3
"""Weight of squared steps: among equally smooth paths the shorter one."""


def smoothest(knots: Sequence[Rows], start: Array | None = None) -> Array | None:
    """Path (K, N, 2) of least squared second differences; knot k meets knots[k], knot 0 is `start` where one is given.

    None: proved infeasible.  Raises SolverFailed where no solver could tell.
    """
    count = knots[0].V.shape[1]
    fixed = [] if start is None else [_at(start)]
    equal: list[tuple[Array, Array]] = []
    least: list[tuple[Array, Array]] = []
    for k, rows in enumerate([*fixed, *knots[len(fixed) :]]):
        for left, right, bucket in _one_sided(rows):
            wide = np.zeros((len(right), len(knots), 2 * count))
            wide[:, k] = left
            bucket_list = equal if bucket else least
            bucket_list.append((wide.reshape(-1, len(knots) * 2 * count), right))
    H = _cost(len(knots), 2 * count)
    A, b = (np.concatenate([part[i] for part in equal + least]) for i in (0, 1))
    equalities = np.int64(sum(len(right) for _, right in equal))
    status, x, _ = solve_qp(H, np.zeros(len(H)), A, b, equalities, 10 * len(H))
    if status == INFEASIBLE:
        return None
    if status != SOLVED:
        raise SolverFailed("no quadratic solver found the smoothest path")
    return x.reshape(len(knots), count, 2)


def acceleration(path: Array) -> float:
    """Sum of squared second differences of a path (K, N, 2) over its inner knots."""
    return float((np.diff(path, 2, axis=0) ** 2).sum())


def _at(p: Array) -> Rows:
    size = p.size
    return Rows(np.eye(size).reshape(size, *p.shape), p.ravel(), p.ravel())


def _one_sided(rows: Rows) -> list[tuple[Array, Array, bool]]:
    """(A, b, is_equality) with A x = b or A x >= b, rows of unit length."""
    V = rows.V.reshape(len(rows.V), -1)
    norm = np.maximum(np.linalg.norm(V, axis=1), 1e-12)
    V, low, high = V / norm[:, None], rows.low / norm, rows.high / norm
    equal = rows.low == rows.high
    below, above = ~equal & np.isfinite(low), ~equal & np.isfinite(high)
    return [(V[equal], low[equal], True), (V[below], low[below], False), (-V[above], -high[above], False)]


def _cost(knots: int, size: int) -> Array:
    bend, step = (np.diff(np.eye(knots), order, axis=0) for order in (2, 1))
    per_coordinate = 2 * (bend.T @ bend + SPEED * step.T @ step) + 1e-9 * np.eye(knots)
    return np.asarray(np.kron(per_coordinate, np.eye(size)), dtype=float)
