"""Conditions on fingers that turn with the object, and the finite rows that imply them for a whole range of angles.

A condition is  low <= sum_n (R(t) V_n) . p_n <= high  with one body vector V_n for each finger.  As t runs over a range,
(cos t, sin t) runs along an arc; the rows at the corners of a polygon around that arc imply all of it, because the
condition is linear in (cos t, sin t).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from expert.geometry.pose import Array, perpendicular

STEP = np.radians(2.5)
"""Largest part of an arc that one corner covers: rows are too strict by 1 / cos(STEP / 2) - 1 = 2.4e-4 at most."""


@dataclass(frozen=True)
class Rows:
    """low (m,) <= sum_n V[:, n] . p_n <= high (m,); V (m, N, 2)."""

    V: Array
    low: Array
    high: Array

    @classmethod
    def join(cls, parts: Sequence["Rows"]) -> "Rows":
        """All rows of several sets."""
        return cls(
            np.concatenate([part.V for part in parts]),
            np.concatenate([part.low for part in parts]),
            np.concatenate([part.high for part in parts]),
        )

    def at(self, angle: float) -> "Rows":
        """The same conditions at one orientation of the object."""
        return self._turned(np.array([[np.cos(angle), np.sin(angle)]]))

    def slope(self, angle: float) -> "Rows":
        """Conditions of the same bounds on the derivative by the angle."""
        return self._turned(np.array([[-np.sin(angle), np.cos(angle)]]))

    def over(self, low: float, high: float) -> "Rows":
        """Conditions that imply these at every orientation in [low, high]."""
        return self._turned(around_arc(low, high))

    def _turned(self, corners: Array) -> "Rows":
        c, s = (corners[:, k, None, None, None] for k in (0, 1))
        V = (c * self.V + s * perpendicular(self.V)).reshape(-1, *self.V.shape[1:])
        return Rows(V, np.tile(self.low, len(corners)), np.tile(self.high, len(corners)))

    def violation(self, p: Array) -> Array:
        """How far fingers (N, 2) are outside, (m,); negative inside."""
        value = np.einsum("mnd,nd->m", self.V, p)
        return np.maximum(self.low - value, value - self.high)


def around_arc(low: float, high: float) -> Array:
    """Corners (k, 2) of an open polygon around the unit arc: its ends, and where tangents at equal steps meet."""
    count = max(1, int(np.ceil((high - low) / STEP - 1e-9)))
    half = (high - low) / (2 * count)
    middles = low + (2 * np.arange(count) + 1) * half
    angles = np.concatenate([[low], middles, [high]])
    radii = np.concatenate([[1.0], np.full(count, 1 / np.cos(half)), [1.0]])
    return radii[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
