"""Strict reading of nested mappings: every value is checked where it is taken, and every refusal names its field.

Numbers, flags and words of a noun stand in files under the names of its dataclass fields, with the same defaults: stated there,
once.
"""

import dataclasses
import difflib
import math
from collections.abc import Callable, Collection, Iterator
from types import NoneType
from typing import Any, Literal, get_args, get_origin, get_type_hints

import numpy as np

from expert.errors import InvalidProblem
from expert.geometry.pose import Array

LARGEST = 1e9
"""No SI quantity of a tabletop problem is larger; beyond it, products overflow or lose all digits."""
SMALLEST = 1e-9
"""Least value of a quantity that must be positive and is divided by."""


def shorten(value: object, width: int = 60) -> str:
    """What came, quoted on one line of bounded length."""
    text = repr(value)
    return text if len(text) <= width else text[: width - 3] + "..."


class Section:
    """A mapping of the file under its name, which has the given keys and no other.

    Raises InvalidProblem for anything but a mapping and for unknown keys, at once: a misspelt key is reported as such.
    """

    def __init__(self, data: object, name: str, keys: Collection[str]) -> None:
        if not isinstance(data, dict):
            raise InvalidProblem(
                name or "file", expected=f"a mapping with keys {_list(keys)}", got=shorten(data)
            )
        self.data, self.name = data, name
        for key in data:
            if key not in keys:
                near = difflib.get_close_matches(str(key), list(keys), n=1)
                raise InvalidProblem(
                    self.path(key if isinstance(key, str) else repr(key)),
                    expected=f"one of the keys {_list(keys)}",
                    got="an unknown key",
                    remedy=f"did you mean {near[0]}?" if near else "remove it",
                )

    def __contains__(self, key: str) -> bool:
        return self.data.get(key) is not None

    def path(self, key: str) -> str:
        """Full name of a field of this section, as errors print it."""
        key = (key if len(key) <= 60 else key[:57] + "...") if key.strip() else repr(key)
        return f"{self.name}.{key}" if self.name else key

    def take(self, key: str, what: str) -> object:
        """The raw value of a required field."""
        if key not in self:
            raise InvalidProblem(self.path(key), expected=what, got="nothing", remedy="add the field")
        return self.data[key]

    def number(self, key: str, *, positive: bool = False) -> float:
        """A finite number of sane magnitude; `positive` ones are at least SMALLEST."""
        value = checked_number(self.take(key, "a number"), self.path(key))
        if positive and not value >= SMALLEST:
            raise InvalidProblem(
                self.path(key), expected=f"a positive number (>= {SMALLEST:g})", got=f"{value:g}"
            )
        return value

    def integer(self, key: str, *, least: int = 0) -> int:
        """A whole number >= least."""
        value = self.take(key, "a whole number")
        if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= LARGEST:
            raise InvalidProblem(self.path(key), expected=f"a whole number >= {least}", got=shorten(value))
        return value

    def text(self, key: str) -> str:
        """A string."""
        value = self.take(key, "a text")
        if not isinstance(value, str):
            raise InvalidProblem(self.path(key), expected="a text", got=shorten(value), remedy="quote it")
        return value

    def choice(self, key: str, choices: Collection[str]) -> str:
        """One of the given words."""
        value = self.take(key, " or ".join(choices))
        if not isinstance(value, str) or value not in choices:
            raise InvalidProblem(self.path(key), expected=" or ".join(choices), got=shorten(value))
        return value

    def array(self, key: str, shape: tuple[int | None, ...]) -> Array:
        """Nested lists of numbers of the given shape; None: any length.  An empty list is allowed where the length is free."""
        what = f"lists of numbers of shape ({', '.join('n' if n is None else str(n) for n in shape)})"
        return checked_array(self.take(key, what), shape, self.path(key))

    def flag(self, key: str) -> bool:
        """true or false."""
        value = self.take(key, "true or false")
        if not isinstance(value, bool):
            raise InvalidProblem(self.path(key), expected="true or false", got=shorten(value))
        return value

    def values(self, noun: type, keys: Collection[str] | None = None, **defaults: Any) -> dict[str, Any]:
        """Numbers, flags and words for a dataclass, by default all that it has; those that are missing keep its defaults."""
        hints, read = get_type_hints(noun), {}
        for field in dataclasses.fields(noun):
            if field.name not in (plain_keys(noun) if keys is None else keys):
                continue
            if field.name in self or (field.default is dataclasses.MISSING and field.name not in defaults):
                read[field.name] = self._value(field.name, hints[field.name])
        return {**defaults, **read}

    def _value(self, key: str, hint: Any) -> object:
        hint = _without_none(hint)
        if get_origin(hint) is Literal:
            return self.choice(key, get_args(hint))
        readers: dict[Any, Callable[[str], object]] = {
            bool: self.flag, int: self.integer, float: self.number, str: self.text
        }  # fmt: skip
        return readers[hint](key)

    def section(self, key: str, keys: Collection[str], *, optional: bool = False) -> "Section":
        """A nested mapping; an optional one that is missing reads as empty."""
        if optional and key not in self:
            return Section({}, self.path(key), keys)
        return Section(self.take(key, f"a mapping with keys {_list(keys)}"), self.path(key), keys)

    def sections(self, key: str, keys: Collection[str]) -> Iterator["Section"]:
        """A list of mappings; none where the key is missing."""
        value = self.data.get(key)
        if value is not None and not isinstance(value, list):
            raise InvalidProblem(self.path(key), expected="a list of mappings", got=shorten(value))
        return (Section(item, f"{self.path(key)}[{i}]", keys) for i, item in enumerate(value or []))


def plain_keys(noun: type) -> tuple[str, ...]:
    """Fields of a dataclass that are numbers, flags or words, so that files hold them as they are."""
    hints = {key: _without_none(hint) for key, hint in get_type_hints(noun).items()}
    plain = {
        key for key, hint in hints.items() if hint in (bool, int, float, str) or get_origin(hint) is Literal
    }
    return tuple(field.name for field in dataclasses.fields(noun) if field.name in plain)


def plain_values(noun: Any, keys: Collection[str] | None = None) -> dict[str, Any]:
    """Those fields of a dataclass instance as JSON values; numbers that are not finite, which JSON does not know, as null."""
    read = {key: getattr(noun, key) for key in (plain_keys(type(noun)) if keys is None else keys)}
    return {key: jsonable(value) for key, value in read.items()}


def jsonable(value: Any) -> Any:
    """A number, flag, word or None for a file: None where it is nan or infinite."""
    if isinstance(value, bool | str | NoneType | int):
        return value
    return float(value) if math.isfinite(value) else None


def _without_none(hint: Any) -> Any:
    """T of the hint T | None."""
    parts = [part for part in get_args(hint) if part is not NoneType]
    return parts[0] if NoneType in get_args(hint) and len(parts) == 1 else hint


def checked_number(value: object, field: str) -> float:
    """A finite number of sane magnitude.  Booleans and numbers in quotes are none.  Raises InvalidProblem."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        remedy = "remove the quotes" if isinstance(value, str) else ""
        raise InvalidProblem(field, expected="a number", got=shorten(value), remedy=remedy)
    if not abs(value) <= LARGEST:  # also true for nan
        remedy = (
            "remove nan and inf" if isinstance(value, float) and not math.isfinite(value) else "use SI units"
        )
        raise InvalidProblem(
            field, expected=f"a number of magnitude <= {LARGEST:g}", got=shorten(value), remedy=remedy
        )
    return float(value)


def checked_array(value: object, shape: tuple[int | None, ...], field: str) -> Array:
    """Nested lists as a float array of the given shape.  Raises InvalidProblem that names the offending entry."""
    return np.array(_nested(value, shape, field), dtype=float).reshape(
        [-1 if n is None else n for n in shape]
    )


def _nested(value: object, shape: tuple[int | None, ...], field: str) -> object:
    if not shape:
        return checked_number(value, field)
    if not isinstance(value, list) or shape[0] not in (None, len(value)):
        length = "" if shape[0] is None else f"{shape[0]} "
        what = "numbers" if len(shape) == 1 else "lists"
        raise InvalidProblem(field, expected=f"a list of {length}{what}", got=shorten(value))
    return [_nested(item, shape[1:], f"{field}[{i}]") for i, item in enumerate(value)]


def _list(keys: Collection[str]) -> str:
    return ", ".join(keys)
