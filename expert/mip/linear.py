"""Mixed-integer linear programs assembled straight into sparse rows, for models that are solved many times."""

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike

from expert.geometry.pose import Array
from expert.mip.backends import Answer, Solver, StandardForm, backend
from expert.world.values import IntArray

Term = tuple[ArrayLike, IntArray]
"""(coefficients, variables); axes beyond those of the constraint's right-hand side are summed over."""


class LinearModel:
    """Variables are index arrays; a constraint is a list of terms and a right-hand side, one row per entry of it."""

    def __init__(self) -> None:
        self._low: list[Array] = []
        self._high: list[Array] = []
        self._integral: list[np.ndarray] = []
        self._entries: list[tuple[Array, np.ndarray, np.ndarray]] = []
        self._row_low: list[Array] = []
        self._row_high: list[Array] = []
        self._cost: list[tuple[Array, np.ndarray]] = []
        self._squares: list[tuple[float, np.ndarray, np.ndarray]] = []
        self.columns = self.rows = 0

    def add(
        self, shape: tuple[int, ...], low: ArrayLike, high: ArrayLike, *, integral: bool = False
    ) -> IntArray:
        """New variables with bounds that broadcast to `shape`."""
        count = int(np.prod(shape))
        self._low.append(np.broadcast_to(np.asarray(low, dtype=float), shape).ravel())
        self._high.append(np.broadcast_to(np.asarray(high, dtype=float), shape).ravel())
        self._integral.append(np.full(count, integral))
        self.columns += count
        return np.arange(self.columns - count, self.columns).reshape(shape)

    def binaries(self, *shape: int) -> IntArray:
        """New 0-1 variables."""
        return self.add(shape, 0.0, 1.0, integral=True)

    def at_most(self, terms: Sequence[Term], bound: ArrayLike) -> None:
        """Sum of terms <= bound."""
        self._rows(terms, None, bound)

    def equal(self, terms: Sequence[Term], value: ArrayLike) -> None:
        """Sum of terms == value."""
        self._rows(terms, value, value)

    def minimise(
        self, terms: Sequence[Term], squares: Sequence[tuple[float, IntArray, IntArray]] = ()
    ) -> None:
        """Add terms, and c (x_i - x_j)^2 for the (c, i, j) of `squares`, to the objective."""
        for coefficients, variables in terms:
            values = np.broadcast_to(np.asarray(coefficients, dtype=float), variables.shape)
            self._cost.append((values.ravel(), variables.ravel()))
        self._squares += [(c, i.ravel(), j.ravel()) for c, i, j in squares]

    def _rows(self, terms: Sequence[Term], low: ArrayLike | None, high: ArrayLike) -> None:
        high = np.asarray(high, dtype=float)
        row = self.rows + np.arange(high.size).reshape(high.shape)
        for coefficients, variables in terms:
            c, v = np.broadcast_arrays(np.asarray(coefficients, dtype=float), variables)
            where = np.broadcast_to(row.reshape(row.shape + (1,) * (v.ndim - row.ndim)), v.shape)
            self._entries.append((c.ravel(), where.ravel(), v.ravel()))
        self._row_high.append(high.ravel())
        self._row_low.append(np.full(high.size, -np.inf) if low is None else high.ravel())
        self.rows += high.size

    def form(self) -> StandardForm:
        """The whole model."""
        values, rows, columns = (np.concatenate(part) for part in zip(*self._entries, strict=True))
        A = sp.coo_array((values, (rows, columns)), shape=(self.rows, self.columns)).tocsr()
        A.sum_duplicates()
        A.eliminate_zeros()
        q = np.zeros(self.columns)
        for c, v in self._cost:
            np.add.at(q, v, c)
        return StandardForm(
            P=self._quadratic(),
            q=q,
            A=A,
            row_low=np.concatenate(self._row_low),
            row_high=np.concatenate(self._row_high),
            low=np.concatenate(self._low),
            high=np.concatenate(self._high),
            integral=np.concatenate(self._integral),
        )

    def _quadratic(self) -> sp.coo_array:
        P = sp.coo_array((self.columns, self.columns))
        for c, i, j in self._squares:
            ones = np.full(i.size, 2 * c)
            data, row = np.concatenate([ones, ones, -ones, -ones]), np.concatenate([i, j, i, j])
            P = P + sp.coo_array((data, (row, np.concatenate([i, j, j, i]))), shape=P.shape)
        return sp.coo_array(P)

    def solve(self, solver: Solver = "highs", *, gap: float = 1e-3, time_limit: float = 60.0) -> Answer:
        """Run a backend; see `expert.mip.backends`."""
        return backend(solver)(self.form(), gap, time_limit)
