from dataclasses import dataclass
from typing import Annotated

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from datasets.limits import Number, check_numbers
from datasets.motions import TaskSettings
from datasets.render import Camera, checked_colour
from expert.errors import InvalidProblem

NOTHING = st.one_of(
    st.none(), st.text(), st.booleans(), st.just(np.nan), st.lists(st.integers()), st.complex_numbers()
)


@dataclass(frozen=True)
class Settings:
    mass: Annotated[float, Number(unit="kg", above=0, most=5)] = 1.0
    count: Annotated[int, Number(whole=True, least=2)] = 2
    end: Annotated[float | None, Number(unit="s")] = None
    name: str = "free"

    def __post_init__(self) -> None:
        check_numbers(self, "settings.")


def test_numbers_within_their_limits_pass() -> None:
    Settings(mass=5, count=np.int64(3), end=-1e9, name="")
    Settings(mass=np.float32(1e-9), end=None)


@pytest.mark.parametrize(
    ("field", "value", "words"),
    [
        ("mass", 0, "a positive number of kg, at most 5, got 0"),
        ("mass", 5.1, "a positive number of kg, at most 5, got 5.1"),
        ("count", 1, "a whole number from 2 on, got 1"),
        ("count", 2.0, "a whole number from 2 on, got 2.0"),
        ("count", None, "a whole number from 2 on, got None"),
        ("end", np.inf, "a number of s, got inf"),
    ],
)
def test_others_are_refused_by_name(field: str, value: object, words: str) -> None:
    with pytest.raises(InvalidProblem, match=f"^settings.{field}: expected {words}$"):
        Settings(**{field: value})  # type: ignore[arg-type]


@given(NOTHING, st.sampled_from([Number(), Number(whole=True), Number(above=0), Number(least=-1, most=1)]))
def test_what_is_no_number_is_within_no_limits(value: object, limit: Number) -> None:
    assert not limit.holds(value)


@given(NOTHING.filter(lambda value: value is not None))
def test_settings_of_tasks_and_cameras_take_numbers_alone(value: object) -> None:
    for settings in (TaskSettings, Camera):
        for name in ("mass", "friction", "dt", "steps", "fingers", "scale", "size", "below"):
            if name in settings.__annotations__:
                with pytest.raises(InvalidProblem, match=name):
                    settings(**{name: value})  # type: ignore[arg-type]


@pytest.mark.parametrize("colour", ["red", (1, 2), (1, 2, 256), (1, 2, 0.5), 7, None, [1, 2, "3"]])
def test_colours_are_three_levels(colour: object) -> None:
    assert checked_colour([1, np.uint8(2), 255], "colour") == (1, 2, 255)
    with pytest.raises(InvalidProblem, match=r"^colour: expected three integers from 0 to 255"):
        checked_colour(colour, "colour")
