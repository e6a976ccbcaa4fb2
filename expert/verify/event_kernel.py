"""Critical contact sets of moving fingers on a polygon: compiled loops over contacts and path segments.

A contact (finger i, facet j) at configuration (x, t) and parameter s has the gap g = n.R(t)^T (p(s) - x) - d >= 0.  At a
local maximum of s over the free configurations some contacts with g = 0 have lambda > 0, sum lambda grad_q g = 0 and
sum lambda dg/ds < 0; a minimal such set has two to four members.  For every null vector lambda of its normals,
x drops out: with complex numbers f = sum lambda g = Re(exp(-i t) P) - E, P = sum lambda conj(n) p(s), E = sum lambda d.

null vectors  contact sets                                      equations for (s, t)                     polynomial in s
one           n, -n;  three that span positively                |P| = E, t = arg P (largest f over t)    degree 2
two           n, n, -n;  four                                   Re(exp(-i t) P_k) = E_k for k = a, b     degree 4
"""

import numba
import numpy as np

from expert.geometry.pose import Array

PARALLEL = 1e-9
"""Normals whose cross product is below this are parallel."""
ROUND = 1e-9
"""Relative lengths and rates below this count as zero: contacts that neither close nor open along a segment make no event."""
BEYOND = 1e-7
"""Roots this far outside their segment belong to it."""
TOUCH = 1e-7
"""A contact may miss its facet, or another finger enter the object, by this relative length."""
COLUMNS = 14
"""Of an event: segment, fraction, x, y, angle, slide from, slide to (nan: none), four contacts (-1: none), rate, slide direction."""


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
def roots_in_unit(coefficients: Array, found: Array) -> int:
    """Write the real roots of a polynomial (ascending, degree <= 4) in [0, 1] to `found`; touching ones count.

    Each derivative is monotone between the roots of the next one.  Returns the number of roots.
    """
    n = len(coefficients)
    scale = np.abs(coefficients).max()
    if scale < ROUND:
        return 0
    low, high = -BEYOND, 1 + BEYOND
    chain = np.zeros((n, n))
    chain[0] = coefficients / scale
    for d in range(1, n):
        for k in range(n - d):
            chain[d, k] = chain[d - 1, k + 1] * (k + 1)
    breaks, count = np.empty(n + 2), 2
    breaks[0], breaks[1] = low, high
    for d in range(n - 2, -1, -1):
        c = chain[d, : n - d]
        fresh, m = np.empty(n + 2), 1
        fresh[0] = low
        for k in range(count - 1):
            a, b = breaks[k], breaks[k + 1]
            fa, fb = _value(c, a), _value(c, b)
            if (fa < 0) != (fb < 0):
                fresh[m] = _bisect(c, a, b)
                m += 1
        if d == 0:
            total = m - 1
            found[:total] = fresh[1:m]
            for k in range(count):
                near = abs(_value(c, breaks[k])) < 1e-11
                for j in range(total):
                    near = near and abs(found[j] - breaks[k]) > 1e-9
                if near:
                    found[total] = breaks[k]
                    total += 1
            for j in range(total):
                found[j] = min(max(found[j], 0.0), 1.0)
            return total
        fresh[m] = high
        breaks[: m + 1] = fresh[: m + 1]
        count = m + 1
    return 0


@numba.njit(cache=True)
def _one_sign(c: Array) -> bool:
    """Whether the Bernstein coefficients over [0, 1] of a quartic (ascending) all have one strict sign."""
    b1 = c[0] + c[1] / 4
    b2 = c[0] + c[1] / 2 + c[2] / 6
    b3 = c[0] + 0.75 * c[1] + c[2] / 2 + c[3] / 4
    b4 = c[0] + c[1] + c[2] + c[3] + c[4]
    tiny = 1e-6 * max(abs(c[0]), abs(b1), abs(b2), abs(b3), abs(b4))
    low, high = min(c[0], b1, b2, b3, b4), max(c[0], b1, b2, b3, b4)
    return low > tiny or high < -tiny


@numba.njit(cache=True)
def _least_parallel(normals: Array, m: int) -> tuple[int, int, float]:
    """The two of m normals with the largest cross product, and that."""
    bi, bj, best = 0, 0, 0.0
    for i in range(m):
        for j in range(i + 1, m):
            cross = normals[i, 0] * normals[j, 1] - normals[i, 1] * normals[j, 0]
            if abs(cross) > abs(best):
                bi, bj, best = i, j, cross
    return bi, bj, best


@numba.njit(cache=True)
def null_vectors(normals: Array, m: int, out: Array) -> int:
    """Write a basis of {lambda: sum lambda n = 0} for m normals (m, 2) to rows of `out` (., 4); returns its size, m - rank."""
    out[:] = 0.0
    bi, bj, best = _least_parallel(normals, m)
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
def _spans(normals: Array, m: int) -> bool:
    """Whether no open half-plane holds all m normals."""
    angles = np.sort(np.arctan2(normals[:m, 1], normals[:m, 0]))
    gap = angles[0] + 2 * np.pi - angles[m - 1]
    for k in range(m - 1):
        gap = max(gap, angles[k + 1] - angles[k])
    return gap <= np.pi + PARALLEL


@numba.njit(cache=True)
def _weighted(
    null: Array,
    ids: np.ndarray,
    m: int,
    contacts: np.ndarray,
    normals: Array,
    offsets: Array,
    knots: Array,
    k: int,
) -> tuple[float, float, float, float, float]:
    """P at the segment's start (re, im), its change over the segment (re, im), and E, for one null vector."""
    px, py, dx, dy, e = 0.0, 0.0, 0.0, 0.0, 0.0
    for a in range(m):
        n, j, w = contacts[ids[a], 0], contacts[ids[a], 1], null[a]
        nx, ny = normals[j, 0], normals[j, 1]
        x, y = knots[k, n, 0], knots[k, n, 1]
        sx, sy = knots[k + 1, n, 0] - x, knots[k + 1, n, 1] - y
        px += w * (nx * x + ny * y)
        py += w * (nx * y - ny * x)
        dx += w * (nx * sx + ny * sy)
        dy += w * (nx * sy - ny * sx)
        e += w * offsets[j]
    return px, py, dx, dy, e


@numba.njit(cache=True)
def _single(null: Array, m: int, poses: Array, px: float, py: float, dx: float, dy: float, e: float) -> int:
    """(fraction, angle) rows where |P| falls to E > 0; 0 if lambda is not positive."""
    total = 0.0
    for a in range(m):
        if null[a] <= PARALLEL:
            return 0
        total += null[a]
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
def _double(
    ax: float, ay: float, adx: float, ady: float, ea: float,
    bx: float, by: float, bdx: float, bdy: float, eb: float, poses: Array,
) -> int:  # fmt: skip
    """(fraction, angle) rows with Re(exp(-i t) P_a) = E_a and Re(exp(-i t) P_b) = E_b."""
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
    if _one_sign(c):
        return 0
    found = np.empty(8)
    count = 0
    for r in range(roots_in_unit(c, found)):
        t = found[r]
        px, py, qx, qy = ax + t * adx, ay + t * ady, bx + t * bdx, by + t * bdy
        det = px * qy - py * qx
        if abs(det) > 1e-6:
            cosine, sine = (ea * qy - eb * py) / det, (px * eb - qx * ea) / det
            poses[count, 0], poses[count, 1] = t, np.arctan2(sine, cosine)
            count += 1
            continue
        long, ex, ey, e = (
            np.hypot(px, py),
            px,
            py,
            ea,
        )  # P_a and P_b are parallel: either equation, both its angles
        if np.hypot(qx, qy) > long:
            long, ex, ey, e = np.hypot(qx, qy), qx, qy, eb
        if long > ROUND and abs(e) <= long * (1 + 1e-6):
            turn = np.arccos(min(max(e / long, -1.0), 1.0))
            for sign in (-1.0, 1.0):
                poses[count, 0], poses[count, 1] = t, np.arctan2(ey, ex) + sign * turn
                count += 1
    return count


@numba.njit(cache=True)
def _place(
    ids: np.ndarray,
    m: int,
    contacts: np.ndarray,
    normals: Array,
    offsets: Array,
    fingers: Array,
    angle: float,
    row: Array,
) -> bool:
    """Write the position at which all contacts touch to row[2:4]; where it may slide, a direction to row[12:14].

    False if the contacts cannot all touch there.
    """
    c, s = np.cos(angle), np.sin(angle)
    world, right = np.empty((m, 2)), np.empty(m)
    for a in range(m):
        n, j = contacts[ids[a], 0], contacts[ids[a], 1]
        world[a, 0] = c * normals[j, 0] - s * normals[j, 1]
        world[a, 1] = s * normals[j, 0] + c * normals[j, 1]
        right[a] = world[a, 0] * fingers[n, 0] + world[a, 1] * fingers[n, 1] - offsets[j]
    bi, bj, best = _least_parallel(world, m)
    row[12:14] = 0.0
    if abs(best) <= PARALLEL:
        row[2], row[3] = right[0] * world[0, 0], right[0] * world[0, 1]
        row[12], row[13] = -world[0, 1], world[0, 0]
    else:
        row[2] = (right[bi] * world[bj, 1] - right[bj] * world[bi, 1]) / best
        row[3] = (world[bi, 0] * right[bj] - world[bj, 0] * right[bi]) / best
    missed = world[:, 0] * row[2] + world[:, 1] * row[3] - right
    return np.abs(missed).max() <= TOUCH


@numba.njit(cache=True)
def _on_facets(
    ids: np.ndarray,
    m: int,
    contacts: np.ndarray,
    starts: Array,
    tangents: Array,
    lengths: Array,
    fingers: Array,
    row: Array,
) -> bool:
    """Whether every contact point lies on its facet; where the object may slide, clip row[5:7] to where they all do."""
    c, s = np.cos(row[4]), np.sin(row[4])
    slides = row[12] != 0.0 or row[13] != 0.0
    low, high = -np.inf, np.inf
    for a in range(m):
        n, j = contacts[ids[a], 0], contacts[ids[a], 1]
        tx, ty = c * tangents[j, 0] - s * tangents[j, 1], s * tangents[j, 0] + c * tangents[j, 1]
        along = tx * (fingers[n, 0] - row[2]) + ty * (fingers[n, 1] - row[3])
        along -= tangents[j, 0] * starts[j, 0] + tangents[j, 1] * starts[j, 1]
        if not slides:
            if along < -TOUCH or along > lengths[j] + TOUCH:
                return False
        elif tx * row[12] + ty * row[13] > 0:  # along falls as the object slides on
            low, high = max(low, along - lengths[j]), min(high, along)
        else:
            low, high = max(low, -along), min(high, lengths[j] - along)
    row[5], row[6] = (low - TOUCH, high + TOUCH) if slides else (np.nan, np.nan)
    return not slides or row[5] <= row[6]


@numba.njit(cache=True)
def _closes(
    ids: np.ndarray,
    m: int,
    null: Array,
    count: int,
    contacts: np.ndarray,
    normals: Array,
    knots: Array,
    row: Array,
) -> bool:
    """Whether lambda >= 0 balances the contacts and their gaps close; writes the rate sum lambda dg/ds to row[11]."""
    c, s = np.cos(row[4]), np.sin(row[4])
    k, t = int(row[0]), row[1]
    moments, rates = np.zeros(2), np.zeros(2)
    for b in range(count):
        for a in range(m):
            n, j = contacts[ids[a], 0], contacts[ids[a], 1]
            nx, ny = c * normals[j, 0] - s * normals[j, 1], s * normals[j, 0] + c * normals[j, 1]
            vx, vy = knots[k + 1, n, 0] - knots[k, n, 0], knots[k + 1, n, 1] - knots[k, n, 1]
            x, y = knots[k, n, 0] + t * vx - row[2], knots[k, n, 1] + t * vy - row[3]
            moments[b] += null[b, a] * (x * ny - y * nx)
            rates[b] += null[b, a] * (nx * vx + ny * vy)
    first, second = (moments[1], -moments[0]) if count == 2 else (1.0, 0.0)
    total, least, sign = 0.0, np.inf, 0.0
    for a in range(m):
        sign += first * null[0, a] + second * null[1, a]
    sign = 1.0 if sign > 0 else -1.0
    for a in range(m):
        weight = sign * (first * null[0, a] + second * null[1, a])
        total += abs(weight)
        least = min(least, weight)
    if total <= ROUND:
        return False  # all lines of force meet: fewer contacts balance, and are a set of their own
    row[11] = sign * (first * rates[0] + second * rates[1]) / total
    return least >= -1e-7 * total and row[11] <= ROUND


@numba.njit(cache=True)
def _try_set(
    ids: np.ndarray, m: int, contacts: np.ndarray, normals: Array, offsets: Array, starts: Array, tangents: Array,
    lengths: Array, knots: Array, events: Array, count: int,
) -> int:  # fmt: skip
    """Append the events of one contact set, on all segments, to `events` (., COLUMNS); returns the new count."""
    chosen = np.empty((m, 2))
    for a in range(m):
        chosen[a] = normals[contacts[ids[a], 1]]
    if not _spans(chosen, m):
        return count
    null = np.empty((3, 4))
    size = null_vectors(chosen, m, null)
    if size == 0 or size > 2:
        return count
    poses, row = np.empty((16, 2)), np.empty(COLUMNS)
    for k in range(len(knots) - 1):
        ax, ay, adx, ady, ea = _weighted(null[0], ids, m, contacts, normals, offsets, knots, k)
        if size == 1:
            solutions = _single(null[0], m, poses, ax, ay, adx, ady, ea)
        else:
            bx, by, bdx, bdy, eb = _weighted(null[1], ids, m, contacts, normals, offsets, knots, k)
            solutions = _double(ax, ay, adx, ady, ea, bx, by, bdx, bdy, eb, poses)
        for r in range(solutions):
            row[0], row[1], row[4] = k, poses[r, 0], poses[r, 1]
            row[7:11] = -1.0
            for a in range(m):
                row[7 + a] = ids[a]
            fingers = knots[k] + row[1] * (knots[k + 1] - knots[k])
            if (
                count < len(events)
                and _place(ids, m, contacts, normals, offsets, fingers, row[4], row)
                and _closes(ids, m, null, size, contacts, normals, knots, row)
                and _on_facets(ids, m, contacts, starts, tangents, lengths, fingers, row)
            ):
                events[count] = row
                count += 1
    return count


@numba.njit(cache=True)
def closing_contacts(
    contacts: np.ndarray, compatible: np.ndarray, normals: Array, offsets: Array, starts: Array, tangents: Array,
    lengths: Array, knots: Array, events: Array,
) -> int:  # fmt: skip
    """Fill `events` (., COLUMNS) with every configuration at which a minimal contact set closes; returns how many.

    contacts (C, 2): finger, facet.  compatible (C, C): whether both can be touched at once.  knots (K, N, 2).  The other
    fingers are not looked at.  As many events as there are rows may mean that some are missing.
    """
    count, total = 0, len(contacts)
    ids = np.empty(4, np.int64)
    for a in range(total):
        ids[0] = a
        for b in range(a + 1, total):
            if not compatible[a, b]:
                continue
            ids[1] = b
            count = _try_set(
                ids, 2, contacts, normals, offsets, starts, tangents, lengths, knots, events, count
            )
            for c in range(b + 1, total):
                if not (compatible[a, c] and compatible[b, c]):
                    continue
                ids[2] = c
                count = _try_set(
                    ids, 3, contacts, normals, offsets, starts, tangents, lengths, knots, events, count
                )
                for d in range(c + 1, total):
                    if compatible[a, d] and compatible[b, d] and compatible[c, d]:
                        ids[3] = d
                        count = _try_set(
                            ids,
                            4,
                            contacts,
                            normals,
                            offsets,
                            starts,
                            tangents,
                            lengths,
                            knots,
                            events,
                            count,
                        )
    return count
