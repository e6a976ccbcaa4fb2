"""Checked values."""

from typing import Any

import numpy as np
import pytest

from expert.errors import InvalidProblem
from expert.world.values import readonly, require, require_time


def test_arrays_are_copied_converted_and_frozen() -> None:
    given = np.array([[1, 2], [3, 4]])
    array = readonly(given, (None, 2), "x")
    given[0, 0] = 9
    np.testing.assert_array_equal(array, [[1.0, 2], [3, 4]])
    with pytest.raises(ValueError, match="read-only"):
        array[0, 0] = 5.0


@pytest.mark.parametrize(
    ("values", "complaint"),
    [
        ([[1, 2, 3]], r"x: expected numbers of shape \(n, 2\)"),
        ([1, 2], r"x: expected numbers of shape \(n, 2\)"),
        ("ab", r"x: expected numbers of shape \(n, 2\), got 'ab'"),
        ([[1, np.inf]], "x: expected finite numbers, .*; remove nan and inf"),
    ],
)
def test_other_arrays_are_refused(values: Any, complaint: str) -> None:
    with pytest.raises(InvalidProblem, match=f"^{complaint}"):
        readonly(values, (None, 2), "x")


def test_a_comparison_with_nan_is_not_ok() -> None:
    require(True, "x", "a number", 1)
    with pytest.raises(InvalidProblem, match=r"^x: expected a number, got nan; mend it$"):
        require(np.nan > 0, "x", "a number", np.nan, "mend it")


@pytest.mark.parametrize("limit", [0, -1, np.inf, np.nan])
def test_a_time_limit_is_a_positive_number_of_seconds(limit: float) -> None:
    require_time(0.1)
    with pytest.raises(InvalidProblem, match=r"^options.time_limit: "):
        require_time(limit)
