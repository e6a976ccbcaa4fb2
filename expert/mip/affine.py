"""Affine expressions over the variables of one model, combined as numpy combines arrays: models read like equations.

d = p - ahead(p)
model.add(A @ d <= b * H, H.sum(axis=1) == 1)
"""

from dataclasses import dataclass
from typing import Any, Union

import numpy as np
from numpy.typing import ArrayLike

from expert.geometry.pose import Array
from expert.world.values import IntArray

Operand = Union["Affine", ArrayLike]


@dataclass(frozen=True)
class Term:
    """Coefficients and variables that broadcast to (k, *shape) of an expression: summed over the first axis."""

    c: Array
    v: IntArray

    def lifted(self, ndim: int) -> "Term":
        """The same for an expression with so many axes: new ones come first, as in numpy."""
        return Term(_lifted(self.c, ndim), _lifted(self.v, ndim)) if ndim > self.v.ndim - 1 else self

    def full(self, shape: tuple[int, ...]) -> "Term":
        """With both arrays (k, *shape)."""
        whole = (max(len(self.c), len(self.v)) if len(self.c) and len(self.v) else 0, *shape)
        return Term(_broadcast(self.c, whole), _broadcast(self.v, whole))


class Affine:
    """A constant and terms for each entry of `shape`.  Operators follow numpy; <=, >= and == make constraints of it."""

    __array_ufunc__ = None  # arrays on the left leave the operation to this class
    __hash__ = None  # type: ignore[assignment]

    def __init__(self, terms: list[Term], constant: Array, shape: tuple[int, ...]) -> None:
        self.terms, self.constant, self.shape = terms, constant, shape

    @classmethod
    def of_variables(cls, index: IntArray) -> "Affine":
        """The variables themselves."""
        return cls([Term(np.ones((1,) * (index.ndim + 1)), index[None])], np.zeros(()), index.shape)

    @property
    def ndim(self) -> int:
        """Number of axes."""
        return len(self.shape)

    @property
    def size(self) -> int:
        """Number of entries."""
        return int(np.prod(self.shape))

    def __len__(self) -> int:
        return self.shape[0]

    def __add__(self, other: Operand) -> "Affine":
        other = other if isinstance(other, Affine) else _constant(other)
        shape = np.broadcast_shapes(self.shape, other.shape)
        terms = [term.lifted(len(shape)) for term in (*self.terms, *other.terms)]
        return Affine(terms, self.constant + other.constant, shape)

    __radd__ = __add__

    def __neg__(self) -> "Affine":
        return Affine([Term(-term.c, term.v) for term in self.terms], -self.constant, self.shape)

    def __sub__(self, other: Operand) -> "Affine":
        return self + (-other if isinstance(other, Affine) else -np.asarray(other, dtype=float))

    def __rsub__(self, other: ArrayLike) -> "Affine":
        return -self + other

    def __mul__(self, factor: ArrayLike) -> "Affine":
        factor = np.asarray(factor, dtype=float)
        shape = np.broadcast_shapes(self.shape, factor.shape)
        lifted = [term.lifted(len(shape)) for term in self.terms]
        return Affine([Term(term.c * factor, term.v) for term in lifted], self.constant * factor, shape)

    __rmul__ = __mul__

    def __matmul__(self, matrix: Array) -> "Affine":
        """self (..., d) @ matrix (d,) or (d, h)."""
        if np.ndim(matrix) == 1:
            return (self * matrix).sum(axis=-1)
        return (self[..., None, :] * np.transpose(matrix)).sum(axis=-1)

    def __rmatmul__(self, matrix: Array) -> "Affine":
        """Matrix (..., d) @ self (d,) or (d, n)."""
        if self.ndim == 1:
            return (self * matrix).sum(axis=-1)
        return (self * np.asarray(matrix)[..., None]).sum(axis=-2)

    def sum(self, axis: int) -> "Affine":
        """Over one axis."""
        axis %= self.ndim
        terms = [_summed(term, self.shape, axis) for term in self.terms]
        constant = _broadcast(self.constant, self.shape).sum(axis=axis)
        return Affine(terms, constant, (*self.shape[:axis], *self.shape[axis + 1 :]))

    def __getitem__(self, key: Any) -> "Affine":
        key = key if isinstance(key, tuple) else (key,)
        constant = np.broadcast_to(self.constant, self.shape)[key]
        ndim, within = constant.ndim, (slice(None), *key)
        terms = []
        for term in self.terms:
            alike = term.c.size == len(term.c)  # coefficients that do not vary along the axes
            c = (
                _lifted(term.c.ravel(), ndim)
                if alike
                else _broadcast(term.c, term.c.shape[:1] + self.shape)[within]
            )
            terms.append(Term(c, _broadcast(term.v, term.v.shape[:1] + self.shape)[within]))
        return Affine(terms, constant, constant.shape)

    def reshape(self, *shape: int) -> "Affine":
        """The same entries in another shape (row-major)."""
        constant = np.broadcast_to(self.constant, self.shape).reshape(shape)
        full = [term.full(self.shape) for term in self.terms]
        terms = [
            Term(t.c.reshape(len(t.c), *constant.shape), t.v.reshape(len(t.v), *constant.shape)) for t in full
        ]
        return Affine(terms, constant, constant.shape)

    @property
    def T(self) -> "Affine":
        """Axes in reverse order."""
        turned = [0, *range(self.ndim, 0, -1)]
        terms = [Term(t.c.transpose(turned), t.v.transpose(turned)) for t in self.terms]
        return Affine(terms, np.broadcast_to(self.constant, self.shape).T, self.shape[::-1])

    def at(self, x: Array) -> Array:
        """The value (shape) at a point x of the whole model."""
        value = np.broadcast_to(self.constant, self.shape).astype(float)
        for term in self.terms:
            value += (term.c * x[term.v]).sum(axis=0)
        return value

    def __le__(self, other: Operand) -> "Constraint":
        return Constraint(self - other, is_equality=False)

    def __ge__(self, other: Operand) -> "Constraint":
        return Constraint(-self + other, is_equality=False)

    def __eq__(self, other: Operand) -> "Constraint":  # type: ignore[override]
        return Constraint(self - other, is_equality=True)


@dataclass(frozen=True)
class Constraint:
    """excess <= 0, or == 0, for every entry."""

    excess: Affine
    is_equality: bool


def _broadcast(array: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    return array if array.shape == shape else np.broadcast_to(array, shape)


def _constant(value: ArrayLike) -> Affine:
    array = np.asarray(value, dtype=float)
    return Affine([], array, array.shape)


def _lifted(array: np.ndarray, ndim: int) -> np.ndarray:
    """(k, *shape) with ones between so that ndim axes follow the first."""
    return array.reshape(len(array), *(1,) * (ndim + 1 - array.ndim), *array.shape[1:])


def _summed(term: Term, shape: tuple[int, ...], axis: int) -> Term:
    """Move one axis of the expression into the first of the term."""
    each = term.full(shape)
    left = (*shape[:axis], *shape[axis + 1 :])
    c, v = np.moveaxis(each.c, axis + 1, 1), np.moveaxis(each.v, axis + 1, 1)
    return Term(c.reshape(-1, *left), v.reshape(-1, *left))
