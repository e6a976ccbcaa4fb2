"""Envelopes of the bilinear surface w = u v over boxes, and their piecewise union (Thesis 3-CT8, 3-CT9)."""

from dataclasses import dataclass

import cvxpy as cp
import numpy as np
from cvxpy.constraints.constraint import Constraint

from expert.geometry.pose import Array


@dataclass(frozen=True)
class Cells:
    """Boxes [u_low, u_high] x [v_low, v_high] that cover the domain of (u, v); each array of shape (k,)."""

    u_low: Array
    u_high: Array
    v_low: Array
    v_high: Array

    @classmethod
    def sign_split(cls, u_max: float, v_max: float, segments: int) -> "Cells":
        """M equal segments of u over [-u_max, u_max], each once for v >= 0 and once for v <= 0: 2 M cells."""
        knots = np.linspace(-u_max, u_max, segments + 1)
        zero, full = np.zeros(segments), np.full(segments, v_max)
        return cls(
            np.tile(knots[:-1], 2),
            np.tile(knots[1:], 2),
            np.concatenate([zero, -full]),
            np.concatenate([full, zero]),
        )

    def __len__(self) -> int:
        return len(self.u_low)

    @property
    def largest_error(self) -> float:
        """Largest |w - u v| that an envelope admits: a quarter of the largest cell's area, at its centre."""
        return float(np.max((self.u_high - self.u_low) * (self.v_high - self.v_low))) / 4


def envelope(u: cp.Expression, v: cp.Expression, choice: cp.Expression, cells: Cells) -> tuple[list, list]:
    """Two planes below and two above w = u v over each cell, scaled by `choice`: McCormick's hull where it is 1.

    u, v, choice: (..., k), cvxpy expressions or arrays.
    """

    def plane(at_u: Array, at_v: Array) -> cp.Expression:
        """The plane through the two edges of the surface that meet at the corner (at_u, at_v)."""
        return cp.multiply(at_u, v) + cp.multiply(at_v, u) - cp.multiply(at_u * at_v, choice)

    below = [plane(cells.u_low, cells.v_low), plane(cells.u_high, cells.v_high)]
    above = [plane(cells.u_low, cells.v_high), plane(cells.u_high, cells.v_low)]
    return below, above


def piecewise(
    w: cp.Expression, u: cp.Expression, v: cp.Expression, choice: cp.Expression, cells: Cells
) -> list[Constraint]:
    """(u, v, w) in the envelope of the cell that `choice` (..., k) selects; u = v = w = 0 where it selects none.

    Hull formulation: u and v are sums of one copy per cell, so no big-M enters and relaxing `choice` gives exactly
    the convex hull of the union.
    """
    u_k, v_k = cp.Variable(choice.shape, name="u_k"), cp.Variable(choice.shape, name="v_k")
    below, above = envelope(u_k, v_k, choice, cells)
    return [
        cp.sum(choice, axis=-1) <= 1,
        *(x == cp.sum(x_k, axis=-1) for x, x_k in ((u, u_k), (v, v_k))),
        *(x_k >= cp.multiply(low, choice) for x_k, low in ((u_k, cells.u_low), (v_k, cells.v_low))),
        *(x_k <= cp.multiply(high, choice) for x_k, high in ((u_k, cells.u_high), (v_k, cells.v_high))),
        *(w >= cp.sum(plane, axis=-1) for plane in below),
        *(w <= cp.sum(plane, axis=-1) for plane in above),
    ]
