"""Envelopes hold the surface w = u v, touch it at the cells' corners, and stray no further than they say."""

import cvxpy as cp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from expert.mip.mccormick import Cells, envelope, piecewise
from expert.mip.solve import solve

U, V = 0.8, 3.0
shares = st.floats(-1, 1)


def planes(u: np.ndarray, v: np.ndarray, cells: Cells) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper envelope of w over each cell, (k,) each."""
    below, above = envelope(cp.Constant(u), cp.Constant(v), cp.Constant(np.ones(len(cells))), cells)
    return np.max([p.value for p in below], axis=0), np.min([p.value for p in above], axis=0)


def range_of_w(constraints: list, w: cp.Variable) -> tuple[float, float]:
    ends = [solve(cp.Problem(cp.Minimize(sign * w), constraints), solver="highs") for sign in (1, -1)]
    assert [r.status for r in ends] == ["optimal", "optimal"]
    return ends[0].value, -ends[1].value


@settings(max_examples=200, deadline=None)
@given(shares, shares, st.integers(1, 6))
def test_the_surface_lies_in_the_envelope_of_its_cell(a: float, b: float, segments: int) -> None:
    cells = Cells.sign_split(U, V, segments)
    u, v = a * U, b * V
    mine = (cells.u_low <= u) & (u <= cells.u_high) & (cells.v_low <= v) & (v <= cells.v_high)
    assert mine.any()
    low, high = planes(np.full(len(cells), u), np.full(len(cells), v), cells)
    assert (low[mine] <= u * v + 1e-12).all()
    assert (high[mine] >= u * v - 1e-12).all()
    assert (high[mine] - low[mine] <= 2 * cells.largest_error + 1e-12).all()
    assert (
        max(np.abs(high - u * v)[mine].max(), np.abs(low - u * v)[mine].max()) <= cells.largest_error + 1e-12
    )


def test_envelopes_touch_the_surface_at_the_corners() -> None:
    cells = Cells.sign_split(U, V, 4)
    for u in (cells.u_low, cells.u_high):
        for v in (cells.v_low, cells.v_high):
            low, high = planes(u, v, cells)
            np.testing.assert_allclose(low, u * v, atol=1e-12)
            np.testing.assert_allclose(high, u * v, atol=1e-12)


def test_the_stated_error_is_reached_at_a_cell_s_centre() -> None:
    cells = Cells.sign_split(U, V, 2)
    u, v = (cells.u_low + cells.u_high) / 2, (cells.v_low + cells.v_high) / 2
    low, high = planes(u, v, cells)
    np.testing.assert_allclose(np.maximum(high - u * v, u * v - low), cells.largest_error)


def test_the_sign_of_the_surface_is_kept() -> None:
    """Property 3 of Thesis 3.1.2, mended: u v >= 0 => w >= 0, u v <= 0 => w <= 0, wherever u = 0 is a knot."""
    cells = Cells.sign_split(U, V, 4)
    for u, v in ((0.3, 1.0), (-0.3, -1.0), (0.3, -1.0), (-0.3, 1.0)):
        mine = (cells.u_low <= u) & (u <= cells.u_high) & (cells.v_low <= v) & (v <= cells.v_high)
        low, high = planes(np.full(8, u), np.full(8, v), cells)
        assert (np.sign(u * v) * low[mine] >= -1e-12).all()
        assert (np.sign(u * v) * high[mine] >= -1e-12).all()


@pytest.mark.parametrize("printed", ["lower", "upper"])
def test_the_planes_as_printed_cut_off_exact_points(printed: str) -> None:
    """Rows 2 and 3 of 3-CT8 as printed exclude points of the surface; see docs/errata.md."""
    u, v = np.meshgrid(np.linspace(0.25, 0.5, 9), np.linspace(0, 1, 9))
    w = u * v
    if printed == "lower":
        assert (w < 0.5 * v + u - 0.25 - 1e-9).any()  # w >= u_k v + u - u_{k-1}
        assert (w >= 0.5 * v + u - 0.5 - 1e-12).all()
    else:
        assert (w > 0.25 * v + u - 0.5 + 1e-9).any()  # w <= u_{k-1} v + u - u_k
        assert (w <= 0.25 * v + u - 0.25 + 1e-12).all()


@pytest.fixture
def model() -> tuple[cp.Variable, cp.Variable, cp.Variable, cp.Variable, Cells, list]:
    cells = Cells.sign_split(U, V, 4)
    w, u, v = (cp.Variable(name=name) for name in "wuv")
    choice = cp.Variable(len(cells), boolean=True)
    return w, u, v, choice, cells, piecewise(w, u, v, choice, cells)


def test_a_chosen_cell_forces_the_surface_at_its_corners(model: tuple) -> None:
    w, u, v, choice, cells, constraints = model
    for k in (0, 3, 6):
        chosen = [*constraints, choice == np.eye(8)[k]]
        for at_u, at_v in ((cells.u_low[k], cells.v_high[k]), (cells.u_high[k], cells.v_low[k])):
            low, high = range_of_w([*chosen, u == at_u, v == at_v], w)
            assert low == pytest.approx(at_u * at_v, abs=1e-9)
            assert high == pytest.approx(at_u * at_v, abs=1e-9)
        outside = cp.Problem(cp.Minimize(0), [*chosen, u == cells.u_high[k] + 0.01])
        assert solve(outside, solver="highs").status == "infeasible"


def test_no_cell_means_no_product(model: tuple) -> None:
    w, u, v, choice, _, constraints = model
    for x in (w, u, v):
        assert range_of_w([*constraints, choice == 0], x) == pytest.approx((0, 0), abs=1e-9)


def test_a_cell_that_is_not_chosen_binds_nothing(model: tuple) -> None:
    w, u, v, choice, cells, constraints = model
    k, point = 7, (cells.u_high[7], cells.v_low[7])
    low, high = range_of_w([*constraints, choice[k] == 1, u == point[0], v == point[1]], w)
    assert (low, high) == pytest.approx((point[0] * point[1],) * 2)


def test_relaxed_choices_give_the_hull_of_the_union() -> None:
    cells = Cells.sign_split(U, V, 4)
    w, u, v = (cp.Variable(name=name) for name in "wuv")
    constraints = piecewise(w, u, v, cp.Variable(8, bounds=[0, 1]), cells)
    for at_u, at_v in ((0.2, 1.0), (-0.5, 2.0), (0.0, 0.0)):
        _, high = range_of_w([*constraints, u == at_u, v == at_v], w)
        assert high == pytest.approx(_hull_height(at_u, at_v, cells))


def _hull_height(u: float, v: float, cells: Cells) -> float:
    """Largest w over convex combinations of the cells' corner points and the origin, by linear programming over them."""
    corners = np.array([(a, b) for a in (cells.u_low, cells.u_high) for b in (cells.v_low, cells.v_high)])
    points = np.concatenate([np.moveaxis(corners, 1, -1).reshape(-1, 2), [[0.0, 0.0]]])
    weight = cp.Variable(len(points), nonneg=True)
    problem = cp.Problem(
        cp.Maximize((points[:, 0] * points[:, 1]) @ weight),
        [weight @ points == np.array([u, v]), cp.sum(weight) == 1],
    )
    return solve(problem, solver="highs").value
