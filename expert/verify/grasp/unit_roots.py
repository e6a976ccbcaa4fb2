"""Real roots of polynomials in [0, 1], compiled: each derivative is monotone between the roots of the next one."""

import numba
import numpy as np

from expert.geometry.pose import Array

ZERO = 1e-9
"""A polynomial whose coefficients are all below this has no roots: it vanishes everywhere or means nothing."""
BEYOND = 1e-7
"""Roots this far outside of [0, 1] count, as its ends."""
TOUCHING = 1e-11
"""A polynomial of coefficients up to 1 that comes this near to zero between its sign changes touches it there."""


@numba.njit(cache=True)
def roots_in_unit(coefficients: Array, found: Array) -> int:
    """Write the real roots of a polynomial (ascending, degree <= 4) in [0, 1] to `found`; touching ones count.

    Returns the number of roots.
    """
    n = len(coefficients)
    scale = np.abs(coefficients).max()
    if scale < ZERO:
        return 0
    chain = np.zeros((n, n))
    chain[0] = coefficients / scale
    for d in range(1, n):
        for k in range(n - d):
            chain[d, k] = chain[d - 1, k + 1] * (k + 1)
    breaks, fresh, count = np.empty(n + 2), np.empty(n + 2), 2
    breaks[0], breaks[1] = -BEYOND, 1 + BEYOND
    for d in range(n - 2, 0, -1):
        m = _sign_changes(chain[d, : n - d], breaks, count, fresh)
        breaks[m + 1] = breaks[count - 1]
        breaks[1 : m + 1] = fresh[:m]
        count = m + 2
    total = _sign_changes(chain[0], breaks, count, found)
    return _touching(chain[0], breaks, count, found, total)


@numba.njit(cache=True)
def _sign_changes(c: Array, breaks: Array, count: int, found: Array) -> int:
    """Write the roots of a polynomial that is monotone between neighbouring breaks, where its sign changes."""
    m = 0
    for k in range(count - 1):
        if (_value(c, breaks[k]) < 0) != (_value(c, breaks[k + 1]) < 0):
            found[m] = _bisect(c, breaks[k], breaks[k + 1])
            m += 1
    return m


@numba.njit(cache=True)
def _touching(c: Array, breaks: Array, count: int, found: Array, total: int) -> int:
    """Append breaks at which the polynomial all but vanishes, then put all roots into [0, 1]; returns their number."""
    for k in range(count):
        near = abs(_value(c, breaks[k])) < TOUCHING
        for j in range(total):
            near = near and abs(found[j] - breaks[k]) > ZERO
        if near:
            found[total] = breaks[k]
            total += 1
    for j in range(total):
        found[j] = min(max(found[j], 0.0), 1.0)
    return total


@numba.njit(cache=True)
def _value(c: Array, t: float) -> float:
    v = 0.0
    for k in range(len(c) - 1, -1, -1):
        v = v * t + c[k]
    return v


@numba.njit(cache=True)
def _bisect(c: Array, low: float, high: float) -> float:
    rising = _value(c, low) < 0
    for _ in range(60):
        middle = 0.5 * (low + high)
        if (_value(c, middle) < 0) == rising:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


@numba.njit(cache=True)
def one_sign(c: Array) -> bool:
    """Whether the Bernstein coefficients over [0, 1] of a quartic (ascending) all have one strict sign."""
    b1 = c[0] + c[1] / 4
    b2 = c[0] + c[1] / 2 + c[2] / 6
    b3 = c[0] + 0.75 * c[1] + c[2] / 2 + c[3] / 4
    b4 = c[0] + c[1] + c[2] + c[3] + c[4]
    tiny = 1e-6 * max(abs(c[0]), abs(b1), abs(b2), abs(b3), abs(b4))
    low, high = min(c[0], b1, b2, b3, b4), max(c[0], b1, b2, b3, b4)
    return low > tiny or high < -tiny
