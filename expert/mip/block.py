"""Blocks of constraints, and implications whose big-M constants follow from the variables' boxes.

A block is what one line of a "subject to" list becomes.  No constant is ever guessed: an implication bounds its
consequent over the box of its variables, so each box needs a physical reason, and a missing one is an error.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import cvxpy as cp
import numpy as np
import scipy.sparse as sp
from cvxpy.constraints.constraint import Constraint
from cvxpy.constraints.nonpos import Inequality
from cvxpy.constraints.zero import Equality

from expert.errors import ExpertError
from expert.geometry.pose import Array


class UnboundedExpression(ExpertError):
    """A big-M constant was asked of an expression whose variables have no finite box."""


@dataclass(frozen=True)
class Block:
    """Constraints that state one equation of the model; `label` cites it, e.g. "3-CT3"."""

    label: str
    constraints: tuple[Constraint, ...]

    @classmethod
    def of(cls, label: str, *parts: Iterable[Constraint] | Constraint) -> "Block":
        """Block from constraints and lists of constraints, in the order given."""
        flat = [[part] if isinstance(part, Constraint) else list(part) for part in parts]
        return cls(label, tuple(c for part in flat for c in part))


def implies(antecedent: cp.Expression, consequent: Constraint) -> list[Constraint]:
    """antecedent = 1 => consequent; nothing is asked where antecedent <= 0.

    antecedent: affine, at most 1 at integral points; its axes are the leading axes of the consequent (==, <= or >=).
    Raises UnboundedExpression where the boxes of the consequent's variables give no finite big-M.
    """
    excess = _excess(consequent)
    low, high = bounds(excess)
    off = 1 - _spread(antecedent, excess.shape)
    constraints = [excess <= cp.multiply(_big_m(np.maximum(high, 0), excess), off)]
    if isinstance(consequent, Equality):
        constraints.append(excess >= cp.multiply(_big_m(np.minimum(low, 0), excess), off))
    return constraints


def disjunction(choice: cp.Expression, alternatives: Sequence[Constraint]) -> list[Constraint]:
    """Exactly one entry of choice (..., k) is 1, and choice[..., k] = 1 => alternatives, whose axes start with (..., k)."""
    return [cp.sum(choice, axis=-1) == 1, *(c for a in alternatives for c in implies(choice, a))]


def bounds(expression: cp.Expression) -> tuple[Array, Array]:
    """Least and largest value of an affine expression over its variables' boxes (+-inf where a box is open)."""
    if expression.is_constant():
        value = np.asarray(expression.value, dtype=float)
        return value, value
    A, offset, low, high = _affine_map(expression)
    positive, negative = A.maximum(0), A.minimum(0)
    for part in (positive, negative):
        part.eliminate_zeros()  # 0 * inf
    least = positive @ low + negative @ high + offset
    largest = positive @ high + negative @ low + offset
    return least.reshape(expression.shape, order="F"), largest.reshape(expression.shape, order="F")


def _affine_map(expression: cp.Expression) -> tuple[sp.csr_array, Array, Array, Array]:
    """A, b with expression = A x + b over all variables x, flattened column-major, and the box of x."""
    problem = cp.Problem(cp.Minimize(0), [expression <= 0])
    data, _, _ = problem.get_problem_data(cp.HIGHS, canon_backend=cp.SCIPY_CANON_BACKEND)
    n = data["A"].shape[1]
    low, high = (data[key] for key in ("lower_bounds", "upper_bounds"))
    low = np.full(n, -np.inf) if low is None else low.copy()
    high = np.full(n, np.inf) if high is None else high.copy()
    binary = np.array(data["bool_vars_idx"], dtype=int)
    low[binary], high[binary] = np.maximum(low[binary], 0), np.minimum(high[binary], 1)
    return sp.csr_array(data["A"]), -data["b"], low, high


def _big_m(constant: Array, expression: cp.Expression) -> Array:
    """The constant, if finite.  Raises UnboundedExpression."""
    if not np.isfinite(constant).all():
        names = ", ".join(sorted(v.name() for v in expression.variables()))
        raise UnboundedExpression(
            f"no big-M for an expression in {names}: expected finite bounds on every variable, got an infinite one; "
            "declare them as cp.Variable(..., bounds=[low, high]) with a physical reason"
        )
    return constant


def _excess(constraint: Constraint) -> cp.Expression:
    """expr of a constraint expr <= 0 or expr == 0."""
    if not isinstance(constraint, Inequality | Equality):
        raise TypeError(
            f"implies: expected an elementwise ==, <= or >=, got {type(constraint).__name__}; split the constraint"
        )
    return constraint.expr


def _spread(antecedent: cp.Expression, shape: tuple[int, ...]) -> cp.Expression:
    """The antecedent with axes appended until it broadcasts against `shape`."""
    missing = len(shape) - antecedent.ndim
    if missing < 0 or any(n not in (1, m) for n, m in zip(antecedent.shape, shape, strict=False)):
        raise ValueError(
            f"implies: expected antecedent axes {antecedent.shape} to lead those of the consequent {shape}"
        )
    spread = cp.reshape(antecedent, antecedent.shape + (1,) * missing, order="F") if missing else antecedent
    return cp.broadcast_to(spread, shape)
