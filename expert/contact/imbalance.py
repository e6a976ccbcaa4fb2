"""Where the balance of a step can be met only just, or missed only just: least cost with the balance held by stiff springs.

Programs whose feasible set is a point, as with forces on the edge of a cone and at the largest force at once, are neither solved nor
proved infeasible by an active-set method: rounding decides.  With springs they always have a solution, and what the springs
still give tells both apart.
"""

import numpy as np

from expert.geometry.pose import Array
from expert.numeric.qp import FEASIBILITY, SOLVED, compiled, solve_qp

STIFF = 1e9
"""Stiffness of the springs, over the curvature of the cost of forces."""
ROUNDS, SHRINKS = 12, 0.5
"""Programs at most, and the share of its length that is left of the imbalance after each, unless it is the least."""


@compiled
def nearly_balanced(
    H: Array, g: Array, A: Array, b: Array, iterations: int
) -> tuple[bool, Array, Array, Array]:
    """Success, x, multipliers y (3,) and imbalance s (3,) of min x'Hx/2 + g'x with A x + s = b in the first three rows, s least.

    The method of multipliers: each program is pulled by the last one's multipliers, so that springs need not be stretched.
    """
    n = g.size
    stiff, pulled, joined = np.zeros((n + 3, n + 3)), np.zeros(n + 3), np.zeros((b.size, n + 3))
    stiff[:n, :n], pulled[:n], joined[:, :n] = H, g, A
    for d in range(3):
        stiff[n + d, n + d] = STIFF
        joined[d, n + d] = 1.0
    x, y, s, least = np.zeros(n), np.zeros(3), np.zeros(3), np.inf
    for i in range(ROUNDS):
        status, v, u = solve_qp(stiff, pulled, joined, b, np.int64(3), iterations)
        if status != SOLVED:
            return i > 0, x, y, s
        x, y, s = v[:n].copy(), u[:3].copy(), v[n:].copy()
        length = float(np.sqrt(s @ s))
        if length <= FEASIBILITY or length > SHRINKS * least:
            break
        least, pulled[n:] = length, y
    return True, x, y, s
