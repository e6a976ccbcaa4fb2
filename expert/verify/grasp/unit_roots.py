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
def roots_in_unit(coefficients: Array) -> Array:
    """Real roots in [0, 1] of a polynomial (ascending coefficients); touching ones count."""
    n = len(coefficients)
    scale = np.abs(coefficients).max()
    if scale < ZERO:
        return np.empty(0)
    derivatives = np.zeros((n, n))
    derivatives[0] = coefficients / scale
    for d in range(1, n):
        for k in range(n - d):
            derivatives[d, k] = derivatives[d - 1, k + 1] * (k + 1)
    breaks = np.array([-BEYOND, 1 + BEYOND])
    for d in range(n - 2, 0, -1):
        roots = _sign_changes(derivatives[d, : n - d], breaks)
        inner = np.empty(len(roots) + 2)
        inner[0], inner[1:-1], inner[-1] = -BEYOND, roots, 1 + BEYOND
        breaks = inner
    crossed = _sign_changes(derivatives[0], breaks)
    return _with_touching(derivatives[0], breaks, crossed)


@numba.njit(cache=True)
def _sign_changes(c: Array, breaks: Array) -> Array:
    """Roots of a polynomial that is monotone between neighbouring breaks, where its sign changes."""
    found, count = np.empty(len(breaks) - 1), 0
    for k in range(len(breaks) - 1):
        if (_value(c, breaks[k]) < 0) != (_value(c, breaks[k + 1]) < 0):
            found[count] = _bisect(c, breaks[k], breaks[k + 1])
            count += 1
    return found[:count]


@numba.njit(cache=True)
def _with_touching(c: Array, breaks: Array, crossed: Array) -> Array:
    """The roots where the sign changes, and the breaks at which the polynomial all but vanishes, put into [0, 1]."""
    found, count = np.empty(len(crossed) + len(breaks)), len(crossed)
    found[:count] = crossed
    for place in breaks:
        near = abs(_value(c, place)) < TOUCHING
        for root in found[:count]:
            near = near and abs(root - place) > ZERO
        if near:
            found[count] = place
            count += 1
    for k in range(count):
        found[k] = min(max(found[k], 0.0), 1.0)
    return found[:count]


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
