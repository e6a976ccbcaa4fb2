"""Named objects [m].  T, I, M and hourglass are those of Thesis 5.1.7."""

import numpy as np

from expert.geometry.pose import Array

_UNIT = 0.01  # the drawings are in centimetres

_OUTLINES = {
    "T": [
        (-5.15, 4.65), (-5.15, 1.1), (-1.65, 1.1), (-1.65, -7.15),
        (1.65, -7.15), (1.65, 1.1), (5.15, 1.1), (5.15, 4.65),
    ],
    "I": [
        (-5.15, -5.15), (5.15, -5.15), (5.15, -2.85), (1.65, -2.85), (1.65, 2.85), (5.15, 2.85),
        (5.15, 5.15), (-5.15, 5.15), (-5.15, 2.85), (-1.65, 2.85), (-1.65, -2.85), (-5.15, -2.85),
    ],
    "M": [
        (-5.15, -5.15), (-2.15, -5.15), (-2.15, 2.0625728155339806), (0, -0.15), (2.15, 2.0625728155339806),
        (2.15, -5.15), (5.15, -5.15), (5.15, 5.15), (-5.15, 5.15),
    ],
    "hourglass": [(-5.3, -5.15), (5.3, -5.15), (0.15, 0), (5.3, 5.15), (-5.3, 5.15), (-0.15, 0)],
    # An S of two hooks that open in opposite directions.
    "hooks": [
        (-4, -5), (4, -5), (4, 1), (-2, 1), (-2, 3), (2, 3), (2, 2), (4, 2), (4, 5),
        (-4, 5), (-4, -1), (2, -1), (2, -3), (-2, -3), (-2, -2), (-4, -2),
    ],
    "bracket": [(-4, -5), (4, -5), (4, -2), (-1, -2), (-1, 5), (-4, 5)],
    "arrow": [(-4, -3), (0, -1), (4, -3), (0, 6)],
}  # fmt: skip

NAMES = tuple(_OUTLINES)


def named_shape(name: str) -> Array:
    """Vertices (V, 2) [m] of a named object, counter-clockwise.  Raises KeyError for an unknown name."""
    return _UNIT * np.array(_OUTLINES[name], dtype=float)
