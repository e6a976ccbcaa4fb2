"""Values taken from mappings: checked where they are taken, with the names and defaults of dataclasses."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import pytest

from expert.errors import InvalidProblem
from expert.files.section import Section, checked_array, plain_keys, plain_values


@dataclass(frozen=True, kw_only=True)
class Noun:
    count: int
    length: float = 0.5
    heavy: bool = False
    colour: Literal["red", "green"] = "red"
    limit: int | None = None
    corners: tuple[float, ...] = ()


def values(data: Any, keys: tuple[str, ...] | None = None, **defaults: Any) -> dict[str, Any]:
    return Section(data, "thing", plain_keys(Noun)).values(Noun, keys, **defaults)


def test_numbers_flags_and_words_are_the_plain_fields() -> None:
    assert plain_keys(Noun) == ("count", "length", "heavy", "colour", "limit")


def test_what_is_missing_keeps_the_default_of_the_dataclass() -> None:
    assert Noun(**values({"count": 3})) == Noun(count=3)
    assert values({"count": 3, "limit": None}) == {"count": 3}
    assert values({}, count=7) == {"count": 7}
    assert values({"count": 2}, count=7) == {"count": 2}
    assert values({"length": 2}, ("length",)) == {"length": 2.0}


@pytest.mark.parametrize(
    ("data", "complaint"),
    [
        ({}, "thing.count: expected a whole number, got nothing; add the field"),
        ({"count": 1.5}, "thing.count: expected a whole number >= 0, got 1.5"),
        ({"count": True}, "thing.count: "),
        ({"count": 1, "length": "2"}, "thing.length: .*; remove the quotes"),
        ({"count": 1, "length": float("nan")}, "thing.length: .*; remove nan and inf"),
        ({"count": 1, "length": 1e10}, "thing.length: .*; use SI units"),
        ({"count": 1, "heavy": 1}, "thing.heavy: expected true or false, got 1"),
        ({"count": 1, "colour": "blue"}, "thing.colour: expected red or green, got 'blue'"),
        ({"count": 1, "lenght": 2}, "thing.lenght: .* unknown key; did you mean length?"),
        ([1], r"thing: expected a mapping with keys count, .*, got \[1\]"),
    ],
)
def test_refusals_name_the_field(data: Any, complaint: str) -> None:
    with pytest.raises(InvalidProblem, match=f"^{complaint}"):
        values(data)


def test_values_are_written_as_they_are_read_and_infinity_as_null() -> None:
    noun = Noun(count=3, length=float("inf"), heavy=True, colour="green")
    assert plain_values(noun) == {"count": 3, "length": None, "heavy": True, "colour": "green", "limit": None}
    assert plain_values(noun, ("colour",)) == {"colour": "green"}


def test_arrays_name_the_entry_that_is_wrong() -> None:
    np.testing.assert_array_equal(checked_array([[1, 2], [3, 4]], (None, 2), "x"), [[1.0, 2], [3, 4]])
    assert checked_array([], (None, 2), "x").shape == (0, 2)
    with pytest.raises(InvalidProblem, match=r"^x\[1\]\[0\]: expected a number, got 'a'"):
        checked_array([[1, 2], ["a", 4]], (None, 2), "x")
    with pytest.raises(InvalidProblem, match=r"^x\[0\]: expected a list of 2 numbers, got \[1\]"):
        checked_array([[1]], (None, 2), "x")
