"""Implications: exact where the antecedent holds, silent where it does not, and never with a guessed constant."""

import cvxpy as cp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from expert.mip.block import Block, UnboundedExpression, bounds, disjunction, implies
from expert.mip.solve import solve

LOW, HIGH = -2.0, 5.0


def largest(objective: cp.Expression, constraints: list) -> float:
    result = solve(cp.Problem(cp.Maximize(objective), constraints), solver="highs")
    assert result.status == "optimal"
    return result.value


@pytest.fixture
def x() -> cp.Variable:
    return cp.Variable((2, 3), bounds=[LOW, HIGH], name="x")


@pytest.fixture
def on() -> cp.Variable:
    return cp.Variable(2, boolean=True, name="on")


def test_an_antecedent_of_one_forces_the_equation(x: cp.Variable, on: cp.Variable) -> None:
    target = np.array([[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]])
    constraints = [*implies(on, x == target), on == 1]
    for sign in (1, -1):
        assert largest(sign * cp.sum(x - target), constraints) == pytest.approx(0, abs=1e-9)


def test_an_antecedent_of_zero_asks_for_nothing(x: cp.Variable, on: cp.Variable) -> None:
    constraints = [*implies(on, x == 1.0), *implies(on, x <= 0.5), *implies(on, x >= 1.5), on == 0]
    assert largest(cp.sum(x), constraints) == pytest.approx(6 * HIGH)
    assert largest(-cp.sum(x), constraints) == pytest.approx(-6 * LOW)


def test_only_the_rows_whose_antecedent_holds_are_bound(x: cp.Variable, on: cp.Variable) -> None:
    constraints = [*implies(on, x <= 1.0), on == np.array([1.0, 0.0])]
    assert largest(cp.sum(x), constraints) == pytest.approx(3 * 1.0 + 3 * HIGH)


def test_a_conjunction_forces_only_where_both_hold(x: cp.Variable, on: cp.Variable) -> None:
    both = on[:1] + on[1:] - 1
    constraints = implies(both, x[:1] == x[1:])
    difference = cp.sum(x[0] - x[1])
    assert largest(difference, [*constraints, on == 1]) == pytest.approx(0, abs=1e-9)
    for values in ([0.0, 1.0], [0.0, 0.0]):
        assert largest(difference, [*constraints, on == np.array(values)]) == pytest.approx(3 * (HIGH - LOW))


def test_big_m_is_the_smallest_that_frees() -> None:
    y, on = cp.Variable(bounds=[-1, 3]), cp.Variable(bounds=[0, 1])
    constraints = implies(on, 2 * y + 1 <= 2)
    for value, most in ((1.0, 2.0), (0.5, 4.5), (0.0, 7.0)):  # 2 + (7 - 2)(1 - on)
        assert largest(2 * y + 1, [*constraints, on == value]) == pytest.approx(most)


def test_an_infinite_box_is_refused_by_name() -> None:
    y, on = cp.Variable(3, name="speed", nonneg=True), cp.Variable(3, boolean=True)
    assert implies(on, y >= 3)  # the box bounds 3 - y from above
    with pytest.raises(UnboundedExpression, match=r"speed.*physical reason"):
        implies(on, y <= 3)


def test_an_antecedent_of_foreign_shape_is_refused(x: cp.Variable) -> None:
    with pytest.raises(ValueError, match="lead those of the consequent"):
        implies(cp.Variable(3, boolean=True), x <= 1)


def test_a_cone_is_no_consequent(x: cp.Variable) -> None:
    with pytest.raises(TypeError, match="elementwise"):
        implies(cp.Variable(boolean=True), cp.SOC(cp.sum(x), x[0]))


def test_a_disjunction_is_the_union_of_its_alternatives() -> None:
    y = cp.Variable(bounds=[0, 10], name="y")
    choice = cp.Variable(3, boolean=True)
    low, high = np.array([1.0, 4.0, 8.0]), np.array([2.0, 5.0, 9.0])
    spread = y * np.ones(3)
    constraints = disjunction(choice, [spread >= low, spread <= high])
    assert largest(y, constraints) == pytest.approx(9)
    assert largest(-y, constraints) == pytest.approx(-1)
    assert largest(y, [*constraints, y <= 7.9]) == pytest.approx(5)
    empty = solve(cp.Problem(cp.Minimize(0), [*constraints, y >= 2.1, y <= 3.9]), solver="highs")
    assert empty.status == "infeasible"


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_bounds_are_those_of_the_corners(seed: int) -> None:
    rng = np.random.default_rng(seed)
    low = rng.normal(size=(2, 2))
    high = low + rng.uniform(0, 2, size=(2, 2))
    x = cp.Variable((2, 2), bounds=[low, high])
    on = cp.Variable(3, boolean=True)
    weights = rng.normal(size=(2, 2, 3)) * rng.integers(0, 2, size=(2, 2, 3))
    constant = rng.normal(size=(2, 3))
    expression = cp.einsum("ij,ijk->ik", x, weights) + on[None] + constant
    least, most = bounds(expression)
    corners = np.stack([low[..., None] * weights, high[..., None] * weights])
    np.testing.assert_allclose(least, corners.min(axis=0).sum(axis=1) + constant, atol=1e-12)
    np.testing.assert_allclose(most, corners.max(axis=0).sum(axis=1) + 1 + constant, atol=1e-12)


def test_a_block_keeps_the_order_of_its_parts(x: cp.Variable) -> None:
    block = Block.of("3-CT0", x <= 1, [x >= 0, x <= 2])
    assert block.label == "3-CT0"
    assert [type(c).__name__ for c in block.constraints] == ["Inequality"] * 3
