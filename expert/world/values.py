"""Checked values: what every noun does with the numbers that it is given."""

import numpy as np

from expert.errors import InvalidProblem
from expert.geometry.pose import Array

IntArray = np.ndarray[tuple[int, ...], np.dtype[np.int64]]


def readonly(values: object, shape: tuple[int | None, ...], field: str) -> Array:
    """Finite float array of the given shape (None: any length), made read-only.  Raises InvalidProblem."""
    try:
        array = np.array(values, dtype=float)
    except (TypeError, ValueError):
        array = np.array(np.nan)
    fits = array.ndim == len(shape) and all(n in (None, m) for n, m in zip(shape, array.shape, strict=False))
    if not fits:
        wanted = "(" + ", ".join("n" if n is None else str(n) for n in shape) + ")"
        raise InvalidProblem(field, expected=f"numbers of shape {wanted}", got=repr(values)[:60])
    if not np.isfinite(array).all():
        raise InvalidProblem(
            field, expected="finite numbers", got=repr(values)[:60], remedy="remove nan and inf"
        )
    array.setflags(write=False)
    return array


def require(ok: bool, field: str, expected: str, got: object, remedy: str = "") -> None:
    """Raise InvalidProblem unless `ok`; a comparison with nan is not ok."""
    if not ok:
        raise InvalidProblem(field, expected=expected, got=f"{got}", remedy=remedy)


def require_time(limit: float) -> None:
    """Raise InvalidProblem unless the limit is a positive number of seconds."""
    require(0 < limit < np.inf, "options.time_limit", "a positive number of seconds", limit)
