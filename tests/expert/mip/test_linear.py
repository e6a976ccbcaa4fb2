"""Models built from expressions have the rows that one would write by hand, and expressions follow numpy."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from expert.geometry.pose import Array
from expert.mip.affine import Affine
from expert.mip.linear import LinearModel


def sample() -> tuple[Affine, Affine, Array, Array, Array]:
    """Variables x (3, 2) and H (3, 4), their values at a random point, and the point."""
    model = LinearModel()
    x, H = model.variables((3, 2), -1, 1), model.binaries(3, 4)
    point = np.random.default_rng(0).normal(size=model.columns)
    return x, H, point[:6].reshape(3, 2), point[6:].reshape(3, 4), point


A = np.random.default_rng(1).normal(size=(5, 2))
b = np.arange(5.0)
u = np.array([0.6, 0.8])
FORMULAS: dict[str, Callable] = {
    "difference to the next": lambda x, H: x - x[[1, 2, 0]],
    "half-planes of rows": lambda x, H: A @ x.T - b[:, None] * H[:, 1],
    "half-planes of one": lambda x, H: A @ x[0] - b * H[0, 0],
    "rows times a matrix": lambda x, H: x @ A.T,
    "rows times a vector": lambda x, H: x @ u + u @ x.T,
    "one times a vector": lambda x, H: u @ x[1] - x[2] @ u,
    "sums": lambda x, H: H.sum(axis=1) - H.sum(axis=0)[:3] + x.sum(axis=-1),
    "sums of sums": lambda x, H: (2 * H + b[:4]).sum(axis=0)[None].sum(axis=1),
    "new axes": lambda x, H: (x[:, None, :] * A + 1.0)[1, ..., 0],
    "broadcasting": lambda x, H: 3 - 2 * H[..., None] + x[:, None, :] * u,
    "masks": lambda x, H: H[np.array([True, False, True]), 2, None] * b[:3] - 1,
    "nothing chosen": lambda x, H: H[:, np.zeros(4, dtype=bool)].sum(axis=1) + x[:, 0],
    "shapes": lambda x, H: (H.reshape(2, 6) - 0.5).T + H.reshape(12)[::2].reshape(6, 1),
    "transposed sums": lambda x, H: (x @ A.T).T.sum(axis=0),
}


@pytest.mark.parametrize("formula", FORMULAS.values(), ids=FORMULAS.keys())
def test_expressions_follow_numpy(formula: Callable) -> None:
    x, H, x_value, H_value, point = sample()
    expected = formula(x_value, H_value)
    found = formula(x, H)
    assert found.shape == expected.shape
    np.testing.assert_allclose(found.at(point), expected, atol=1e-14)


def test_rows_are_those_written_by_hand() -> None:
    model = LinearModel()
    p, h = model.variables((2, 2), -1, 2), model.binaries(2)
    model.add(np.array([[1.0, 2.0], [0.0, 3.0]]) @ p.T <= np.array([[5.0], [7.0]]) * h + 1)
    model.add(p[0] - p[1] == u, h.sum(axis=0) >= 1)
    model.minimise(2 * p[0], h)
    form = model.form()
    # columns p00 p01 p10 p11 h0 h1
    by_hand = [
        [1, 2, 0, 0, -5, 0],
        [0, 0, 1, 2, 0, -5],
        [0, 3, 0, 0, -7, 0],
        [0, 0, 0, 3, 0, -7],
        [1, 0, -1, 0, 0, 0],
        [0, 1, 0, -1, 0, 0],
        [0, 0, 0, 0, -1, -1],
    ]
    np.testing.assert_array_equal(form.A.toarray(), by_hand)
    np.testing.assert_array_equal(form.row_high, [1, 1, 1, 1, 0.6, 0.8, -1])
    np.testing.assert_array_equal(form.row_low, [-np.inf] * 4 + [0.6, 0.8, -np.inf])
    np.testing.assert_array_equal(form.q, [2, 2, 0, 0, 1, 1])
    np.testing.assert_array_equal(form.low, [-1, -1, -1, -1, 0, 0])
    np.testing.assert_array_equal(form.high, [2, 2, 2, 2, 1, 1])
    np.testing.assert_array_equal(form.integral, [False] * 4 + [True] * 2)
    assert form.is_linear


def test_squares_are_the_quadratic_form_of_their_expression() -> None:
    model = LinearModel()
    x = model.variables((3,), -1, 1)
    model.add(x.sum(axis=0) <= 3)
    model.minimise_squares(2.0, x[1:] - x[:-1] - 0.5)
    form = model.form()
    point = np.array([0.3, -0.7, 0.2])
    value = 0.5 * point @ (form.P @ point) + form.q @ point
    constant = 2.0 * 2 * 0.5**2
    assert value + constant == pytest.approx(2.0 * ((np.diff(point) - 0.5) ** 2).sum())


def test_bounds_on_both_sides_become_rows_where_they_are_finite() -> None:
    model = LinearModel()
    x = model.variables((4,), -9, 9)
    model.between(np.array([1.0, -np.inf, 2.0, -np.inf]), x, np.array([1.0, 3.0, 4.0, np.inf]))
    form = model.form()
    rows = [
        (row.tolist(), low, high)
        for row, low, high in zip(form.A.toarray(), form.row_low, form.row_high, strict=True)
    ]
    assert rows == [
        ([1, 0, 0, 0], 1, 1),
        ([0, 1, 0, 0], -np.inf, 3),
        ([0, 0, 1, 0], -np.inf, 4),
        ([0, 0, -1, 0], -np.inf, -2),
    ]


@given(st.lists(st.booleans(), min_size=6, max_size=6).filter(any))
def test_an_excluded_point_and_what_contains_it_alone_are_cut_off(ones: list[bool]) -> None:
    model = LinearModel()
    first, second = model.binaries(2, 2), model.binaries(2)
    x = np.array(ones, dtype=float)
    model.exclude(x, first, second)
    form = model.form()
    for code in range(64):
        y = np.array([(code >> k) & 1 for k in range(6)], dtype=float)
        contains = bool((y >= x).all())
        assert bool((form.A @ y > form.row_high).any()) == contains


def test_a_small_program_is_solved_and_read_back() -> None:
    model = LinearModel()
    choice, x = model.binaries(3), model.variables((3,), 0.0, 2.0)
    model.add(x <= 2 * choice, choice.sum(axis=0) == 1)
    model.minimise(-np.array([1.0, 3.0, 2.0]) * x)
    answer = model.solve()
    assert answer.status == "optimal"
    np.testing.assert_allclose(x.at(answer.x), [0, 2, 0], atol=1e-9)
    assert (-np.array([1.0, 3.0, 2.0]) * x).sum(axis=0).at(answer.x) == pytest.approx(-6)
