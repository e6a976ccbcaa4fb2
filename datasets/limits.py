"""Settings that are numbers within limits, stated where the field is: `mass: Annotated[float, Number("kg", above=0)] = 0.1`."""

from dataclasses import dataclass, fields
from numbers import Integral, Real
from typing import Any

import numpy as np

from expert.errors import InvalidProblem


@dataclass(frozen=True, kw_only=True)
class Number:
    """A number (no truth value, not nan) from `least`, or above `above`, to `most`; whole: without a fraction."""

    unit: str = ""
    least: float = -np.inf
    above: float = -np.inf
    most: float = np.inf
    whole: bool = False

    def holds(self, value: object) -> bool:
        """Whether this is such a number."""
        kind = Integral if self.whole else Real
        if not isinstance(value, kind) or isinstance(value, bool | np.bool_):
            return False
        return bool(self.least <= value <= self.most and self.above < value < np.inf)  # type: ignore[operator]

    def __str__(self) -> str:
        sign = "positive " if self.above == 0 else ""
        words = f"a {sign}{'whole ' if self.whole else ''}number"
        words += f" of {self.unit}" if self.unit else ""
        if np.isfinite(self.least):
            end = f" to {self.most:.15g}" if np.isfinite(self.most) else " on"
            return words + f" from {self.least:.15g}{end}"
        return words + (f", at most {self.most:.15g}" if np.isfinite(self.most) else "")


def check_numbers(settings: Any, prefix: str = "") -> None:
    """Raise InvalidProblem, naming `prefix` and field, unless all numbers of a dataclass keep their limits; None may stay None
    where it is the default."""
    for field in fields(settings):
        for limit in getattr(field.type, "__metadata__", ()):
            value = getattr(settings, field.name)
            if not limit.holds(value) and not (value is None and field.default is None):
                raise InvalidProblem(f"{prefix}{field.name}", expected=str(limit), got=f"{value!r}"[:60])
