"""Real roots in [0, 1] against their own construction."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from expert.verify.grasp.unit_roots import one_sign, roots_in_unit

quartics = st.lists(st.floats(-1, 1).map(lambda x: round(x, 6)), min_size=5, max_size=5).map(np.array)


@pytest.mark.parametrize(
    ("roots", "inside"),
    [((0.2, 0.7, 2.0, -1.0), [0.2, 0.7]), ((0.4, 0.4, 3.0, 5.0), [0.4]), ((0.0, 1.0), [0, 1])],
)
def test_roots_in_the_unit_interval_are_found(roots: tuple[float, ...], inside: list[float]) -> None:
    coefficients = np.polynomial.polynomial.polyfromroots(roots)
    found = roots_in_unit(np.ascontiguousarray(coefficients))
    assert {round(x, 5) for x in found} == {round(x, 5) for x in inside}


@settings(max_examples=200, deadline=None)
@given(quartics)
def test_every_sign_change_has_a_root_and_every_root_is_one(coefficients: np.ndarray) -> None:
    found = roots_in_unit(coefficients)
    values = np.polynomial.polynomial.polyval(np.linspace(0, 1, 401), coefficients)
    for k in np.flatnonzero(values[1:] * values[:-1] < 0):  # at least 1e-6 large, or no polynomial
        assert ((found >= k / 400) & (found <= (k + 1) / 400)).any()
    scale = np.abs(coefficients).max()
    assert np.abs(np.polynomial.polynomial.polyval(found, coefficients)).max(initial=0) <= 1e-6 * max(
        scale, 1e-9
    )


@settings(max_examples=200, deadline=None)
@given(quartics)
def test_one_sign_means_no_root(coefficients: np.ndarray) -> None:
    if one_sign(coefficients):
        assert len(roots_in_unit(coefficients)) == 0
