"""Mixed-integer linear programs assembled straight into sparse rows, for models that are solved many times."""

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike

from expert.geometry.pose import Array
from expert.mip.affine import Affine, Constraint, Term
from expert.mip.backends import Answer, Solver, StandardForm, backend


class LinearModel:
    """Variables are affine expressions; a constraint gives one row for each of its entries, in row-major order."""

    def __init__(self) -> None:
        self._low: list[Array] = []
        self._high: list[Array] = []
        self._integral: list[np.ndarray] = []
        self._rows: list[Constraint] = []
        self._cost: list[Affine] = []
        self._squares: list[tuple[float, Affine]] = []
        self.columns = self.rows = 0

    def variables(
        self, shape: tuple[int, ...], low: ArrayLike, high: ArrayLike, *, integral: bool = False
    ) -> Affine:
        """New variables with bounds that broadcast to `shape`."""
        count = int(np.prod(shape))
        self._low.append(np.broadcast_to(np.asarray(low, dtype=float), shape).ravel())
        self._high.append(np.broadcast_to(np.asarray(high, dtype=float), shape).ravel())
        self._integral.append(np.full(count, integral))
        self.columns += count
        return Affine.of_variables(np.arange(self.columns - count, self.columns).reshape(shape))

    def binaries(self, *shape: int) -> Affine:
        """New 0-1 variables."""
        return self.variables(shape, 0.0, 1.0, integral=True)

    def add(self, *constraints: Constraint) -> None:
        """Subject to each of these."""
        self._rows += constraints
        self.rows += sum(constraint.excess.size for constraint in constraints)

    def between(self, low: Array, expression: Affine, high: Array) -> None:
        """Subject to low (m,) <= expression (m,) <= high (m,); infinite bounds ask nothing."""
        equal = low == high
        above, below = ~equal & np.isfinite(high), ~equal & np.isfinite(low)
        self.add(
            expression[equal] == high[equal],
            expression[above] <= high[above],
            -expression[below] <= -low[below],
        )

    def exclude(self, x: Array, *binaries: Affine) -> None:
        """Of the binaries that are 1 at x, at least one must not be."""
        on = [b.reshape(b.size)[b.at(x).ravel() > 0.5] for b in binaries]
        count = sum(ones.size for ones in on)
        self.add(sum((ones.sum(axis=0) for ones in on[1:]), on[0].sum(axis=0)) <= count - 1.0)

    def minimise(self, *costs: Affine) -> None:
        """Add the sum of all entries of each expression to the objective (its constants do not count)."""
        self._cost += costs

    def minimise_squares(self, weight: float, expression: Affine) -> None:
        """Add weight times the sum of squares of all entries to the objective (its constants do not count)."""
        self._squares.append((weight, expression))

    def form(self) -> StandardForm:
        """The whole model."""
        A, constant = _matrix([constraint.excess for constraint in self._rows], self.columns)
        equal = np.concatenate([np.full(c.excess.size, c.is_equality) for c in self._rows])
        P, q = self._objective()
        return StandardForm(
            P=P,
            q=q,
            A=A,
            row_low=np.where(equal, -constant, -np.inf),
            row_high=-constant,
            low=np.concatenate(self._low),
            high=np.concatenate(self._high),
            integral=np.concatenate(self._integral),
        )

    def _objective(self) -> tuple[sp.coo_array, Array]:
        q = np.zeros(self.columns)
        if self._cost:
            q += _matrix(self._cost, self.columns)[0].sum(axis=0)
        P = sp.csr_array((self.columns, self.columns))
        for weight, expression in self._squares:
            E, constant = _matrix([expression], self.columns)
            P = P + 2 * weight * (E.T @ E)
            q += 2 * weight * (E.T @ constant)
        return sp.coo_array(P), q

    def solve(self, solver: Solver = "highs", *, gap: float = 1e-3, time_limit: float = 60.0) -> Answer:
        """Run a backend for at most time_limit [s] of processor time; see `expert.mip.backends`."""
        return backend(solver)(self.form(), gap, time_limit)


def _matrix(expressions: list[Affine], columns: int) -> tuple[sp.csr_array, Array]:
    """A, b with all entries of the expressions = A x + b."""
    entries: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    constants, rows = [], 0
    for expression in expressions:
        row = rows + np.arange(expression.size).reshape(expression.shape)
        entries += [_entries(term.full(expression.shape), row) for term in expression.terms]
        constants.append(np.broadcast_to(expression.constant, expression.shape).ravel())
        rows += expression.size
    values, row, column = (np.concatenate(part) for part in zip(*entries, strict=True))
    A = sp.coo_array((values, (row, column)), shape=(rows, columns)).tocsr()
    A.sum_duplicates()
    A.eliminate_zeros()
    return A, np.concatenate(constants)


def _entries(term: Term, row: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return term.c.ravel(), np.broadcast_to(row, term.v.shape).ravel(), term.v.ravel()
