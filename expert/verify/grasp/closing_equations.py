"""When and at what angle a set of contacts can close: the object's position eliminated by null vectors, compiled.

For every null vector lambda of the contacts' normals, sum lambda n = 0, the position drops out of the sum of gaps: with
complex numbers f = sum lambda g = Re(exp(-i t) P(s)) - E, P = sum lambda conj(n) p(s), E = sum lambda d.  On a segment of
the finger path P is linear in the fraction of it.

null vectors  contact sets                                      equations for (s, t)                     polynomial in s
one           n, -n;  three that span positively                |P| = E, t = arg P (largest f over t)    degree 2
two           n, n, -n;  four                                   Re(exp(-i t) P_k) = E_k for k = a, b     degree 4
"""

import numba
import numpy as np

from expert.geometry.pose import Array
from expert.verify.grasp.finger_path import Facets
from expert.verify.grasp.unit_roots import one_sign, roots_in_unit

PARALLEL = 1e-9
"""Normals whose cross product is below this are parallel."""
ROUND = 1e-9
"""Relative lengths and rates below this count as zero: contacts that neither close nor open along a segment make no event."""
Reduced = tuple[float, float, float, float, float]
"""P at the segment's start (re, im), its change over the segment (re, im), and E."""


@numba.njit(cache=True)
def least_parallel(normals: Array) -> tuple[int, int, float]:
    """The two normals (m, 2) with the largest cross product, and that."""
    bi, bj, best = 0, 0, 0.0
    for i in range(len(normals)):
        for j in range(i + 1, len(normals)):
            cross = normals[i, 0] * normals[j, 1] - normals[i, 1] * normals[j, 0]
            if abs(cross) > abs(best):
                bi, bj, best = i, j, cross
    return bi, bj, best


@numba.njit(cache=True)
def spans(normals: Array) -> bool:
    """Whether no open half-plane holds all normals (m, 2)."""
    angles = np.sort(np.arctan2(normals[:, 1], normals[:, 0]))
    gap = angles[0] + 2 * np.pi - angles[-1]
    for k in range(len(angles) - 1):
        gap = max(gap, angles[k + 1] - angles[k])
    return gap <= np.pi + PARALLEL


@numba.njit(cache=True)
def null_vectors(normals: Array, out: Array) -> int:
    """Write a basis of {lambda: sum lambda n = 0} for normals (m, 2) to rows of `out` (., 4); returns its size, m - rank."""
    out[:] = 0.0
    m = len(normals)
    bi, bj, best = least_parallel(normals)
    count = 0
    if abs(best) <= PARALLEL:
        for k in range(1, m):
            out[count, k] = 1.0
            out[count, 0] = -(normals[0, 0] * normals[k, 0] + normals[0, 1] * normals[k, 1])
            count += 1
        return count
    for k in range(m):
        if k != bi and k != bj:
            out[count, k] = 1.0
            out[count, bi] = -(normals[k, 0] * normals[bj, 1] - normals[k, 1] * normals[bj, 0]) / best
            out[count, bj] = -(normals[bi, 0] * normals[k, 1] - normals[bi, 1] * normals[k, 0]) / best
            largest = max(1.0, abs(out[count, bi]), abs(out[count, bj]))
            out[count] /= largest
            count += 1
    return count


@numba.njit(cache=True)
def closing_poses(
    null: Array, size: int, chosen: np.ndarray, facets: Facets, knots: Array, poses: Array
) -> int:
    """Write to `poses` (., 2) the fractions of a segment, knots (2, N, 2), and angles at which contacts may close.

    null (., 4): so many null vectors, one or two, of the contacts chosen (m, 2): finger, facet.  Returns how many.
    """
    first = _reduced(null[0], chosen, facets, knots)
    if size == 2:
        return _double(first, _reduced(null[1], chosen, facets, knots), poses)
    return _single(null[0, : len(chosen)], first, poses)


@numba.njit(cache=True)
def _reduced(null: Array, chosen: np.ndarray, facets: Facets, knots: Array) -> Reduced:
    """Coefficients of f for one null vector."""
    px, py, dx, dy, e = 0.0, 0.0, 0.0, 0.0, 0.0
    for a in range(len(chosen)):
        n, j, w = chosen[a, 0], chosen[a, 1], null[a]
        nx, ny = facets.normals[j, 0], facets.normals[j, 1]
        x, y = knots[0, n, 0], knots[0, n, 1]
        sx, sy = knots[1, n, 0] - x, knots[1, n, 1] - y
        px += w * (nx * x + ny * y)
        py += w * (nx * y - ny * x)
        dx += w * (nx * sx + ny * sy)
        dy += w * (nx * sy - ny * sx)
        e += w * facets.offsets[j]
    return px, py, dx, dy, e


@numba.njit(cache=True)
def _single(weights: Array, reduced: Reduced, poses: Array) -> int:
    """(fraction, angle) rows where |P| falls to E > 0; none if the weights lambda (m,) are not positive."""
    if weights.min() <= PARALLEL:
        return 0
    total = weights.sum()
    px, py, dx, dy, e = reduced
    px, py, dx, dy, e = px / total, py / total, dx / total, dy / total, e / total
    if e <= 0:
        return 0
    found = np.empty(8)
    c = np.array([px * px + py * py - e * e, 2 * (px * dx + py * dy), dx * dx + dy * dy])
    count = 0
    for r in range(roots_in_unit(c, found)):
        t = found[r]
        x, y = px + t * dx, py + t * dy
        if x * dx + y * dy <= ROUND:
            poses[count, 0], poses[count, 1] = t, np.arctan2(y, x)
            count += 1
    return count


@numba.njit(cache=True)
def _double(a: Reduced, b: Reduced, poses: Array) -> int:
    """(fraction, angle) rows with Re(exp(-i t) P_a) = E_a and Re(exp(-i t) P_b) = E_b."""
    ax, ay, adx, ady, ea = a
    bx, by, bdx, bdy, eb = b
    ux0, ux1 = ea * bx - eb * ax, ea * bdx - eb * adx  # E_a P_b - E_b P_a = (u, v), linear in the fraction
    uy0, uy1 = ea * by - eb * ay, ea * bdy - eb * ady
    d0, d2 = ax * by - ay * bx, adx * bdy - ady * bdx  # the determinant of (P_a, P_b), quadratic
    d1 = ax * bdy + adx * by - ay * bdx - ady * bx
    c = np.array([
        ux0 * ux0 + uy0 * uy0 - d0 * d0,
        2 * (ux0 * ux1 + uy0 * uy1) - 2 * d0 * d1,
        ux1 * ux1 + uy1 * uy1 - d1 * d1 - 2 * d0 * d2,
        -2 * d1 * d2,
        -d2 * d2,
    ])  # fmt: skip
    if one_sign(c):
        return 0
    found = np.empty(8)
    count = 0
    for r in range(roots_in_unit(c, found)):
        t = found[r]
        count = _angles(t, ax + t * adx, ay + t * ady, ea, bx + t * bdx, by + t * bdy, eb, poses, count)
    return count


@numba.njit(cache=True)
def _angles(
    t: float, px: float, py: float, ea: float, qx: float, qy: float, eb: float, poses: Array, count: int
) -> int:
    """Append (t, angle) for the angles at which both equations hold with P_a = (px, py), P_b = (qx, qy)."""
    det = px * qy - py * qx
    if abs(det) > 1e-6:
        cosine, sine = (ea * qy - eb * py) / det, (px * eb - qx * ea) / det
        poses[count, 0], poses[count, 1] = t, np.arctan2(sine, cosine)
        return count + 1
    if np.hypot(qx, qy) > np.hypot(px, py):  # parallel: the longer one decides, with both its angles
        px, py, ea = qx, qy, eb
    long = np.hypot(px, py)
    if long > ROUND and abs(ea) <= long * (1 + 1e-6):
        turn = np.arccos(min(max(ea / long, -1.0), 1.0))
        for sign in (-1.0, 1.0):
            poses[count, 0], poses[count, 1] = t, np.arctan2(py, px) + sign * turn
            count += 1
    return count
