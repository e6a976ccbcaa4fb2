"""Critical contact sets of moving fingers on a polygon: compiled loops over contacts and path segments.

A contact (finger i, facet j) at configuration (x, t) and parameter s has the gap g = n.R(t)^T (p(s) - x) - d >= 0.  At a
local maximum of s over the free configurations some contacts with g = 0 have lambda > 0, sum lambda grad_q g = 0 and
sum lambda dg/ds < 0; a minimal such set has two to four members.  `expert.verify.grasp.closing_equations` gives s and t.
"""

import numba
import numpy as np

from expert.geometry.pose import Array
from expert.verify.grasp.closing_equations import (
    PARALLEL,
    ROUND,
    closing_poses,
    least_parallel,
    null_vectors,
    spans,
)
from expert.verify.grasp.finger_path import Facets

TOUCH = 1e-7
"""A contact may miss its facet, or another finger enter the object, by this relative length, and a weight be so negative."""
COLUMNS = 15
"""Of an event: segment, fraction, x, y, angle, slide from, slide to (nan: none), four contacts (-1: none), rate, slide
direction, and by how much weights, closing rate and (without a slide) places on facets keep clear of their limits."""


@numba.njit(cache=True)
def closing_contacts(
    contacts: np.ndarray, compatible: np.ndarray, facets: Facets, knots: Array, events: Array
) -> int:
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
            count = _try_set(ids[:2], contacts, facets, knots, events, count)
            for c in range(b + 1, total):
                if not (compatible[a, c] and compatible[b, c]):
                    continue
                ids[2] = c
                count = _try_set(ids[:3], contacts, facets, knots, events, count)
                for d in range(c + 1, total):
                    if compatible[a, d] and compatible[b, d] and compatible[c, d]:
                        ids[3] = d
                        count = _try_set(ids, contacts, facets, knots, events, count)
    return count


@numba.njit(cache=True)
def _try_set(
    ids: np.ndarray, contacts: np.ndarray, facets: Facets, knots: Array, events: Array, count: int
) -> int:
    """Append the events of one contact set, on all segments, to `events` (., COLUMNS); returns the new count."""
    m = len(ids)
    chosen, normals = np.empty((m, 2), np.int64), np.empty((m, 2))
    for a in range(m):
        chosen[a] = contacts[ids[a]]
        normals[a] = facets.normals[chosen[a, 1]]
    if not spans(normals):
        return count
    null = np.empty((3, 4))
    size = null_vectors(normals, null)
    if size == 0 or size > 2:
        return count
    poses, row = np.empty((16, 2)), np.empty(COLUMNS)
    for k in range(len(knots) - 1):
        segment = knots[k : k + 2]
        for r in range(closing_poses(null, size, chosen, facets, segment, poses)):
            row[0], row[1], row[4] = k, poses[r, 0], poses[r, 1]
            row[7:11] = -1.0
            row[7 : 7 + m] = ids
            fingers = segment[0] + row[1] * (segment[1] - segment[0])
            if (
                count < len(events)
                and _place(chosen, facets, fingers, row)
                and _closes(chosen, null[:size], facets, segment, row)
                and _on_facets(chosen, facets, fingers, row)
            ):
                events[count] = row
                count += 1
    return count


@numba.njit(cache=True)
def _place(chosen: np.ndarray, facets: Facets, fingers: Array, row: Array) -> bool:
    """Write the position at which all contacts touch to row[2:4]; where it may slide, a direction to row[12:14].

    False if the contacts cannot all touch there.
    """
    m = len(chosen)
    c, s = np.cos(row[4]), np.sin(row[4])
    world, right = np.empty((m, 2)), np.empty(m)
    for a in range(m):
        n, j = chosen[a, 0], chosen[a, 1]
        world[a, 0] = c * facets.normals[j, 0] - s * facets.normals[j, 1]
        world[a, 1] = s * facets.normals[j, 0] + c * facets.normals[j, 1]
        right[a] = world[a, 0] * fingers[n, 0] + world[a, 1] * fingers[n, 1] - facets.offsets[j]
    bi, bj, best = least_parallel(world)
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
def _on_facets(chosen: np.ndarray, facets: Facets, fingers: Array, row: Array) -> bool:
    """Whether every contact point lies on its facet; where the object may slide, clip row[5:7] to where they all do."""
    c, s = np.cos(row[4]), np.sin(row[4])
    slides = row[12] != 0.0 or row[13] != 0.0
    low, high = -np.inf, np.inf
    for a in range(len(chosen)):
        n, j = chosen[a, 0], chosen[a, 1]
        tangent, start, length = facets.tangents[j], facets.starts[j], facets.lengths[j]
        tx, ty = c * tangent[0] - s * tangent[1], s * tangent[0] + c * tangent[1]
        along = tx * (fingers[n, 0] - row[2]) + ty * (fingers[n, 1] - row[3])
        along -= tangent[0] * start[0] + tangent[1] * start[1]
        if not slides:
            row[14] = min(row[14], along, length - along)
            if row[14] < -TOUCH:
                return False
        elif tx * row[12] + ty * row[13] > 0:  # along falls as the object slides on
            low, high = max(low, along - length), min(high, along)
        else:
            low, high = max(low, -along), min(high, length - along)
    row[5], row[6] = (low - TOUCH, high + TOUCH) if slides else (np.nan, np.nan)
    return not slides or row[5] <= row[6]


@numba.njit(cache=True)
def _closes(chosen: np.ndarray, null: Array, facets: Facets, segment: Array, row: Array) -> bool:
    """Whether lambda >= 0 balances the contacts and their gaps close; writes the rate sum lambda dg/ds to row[11]."""
    c, s, t = np.cos(row[4]), np.sin(row[4]), row[1]
    moments, rates = np.zeros(2), np.zeros(2)
    for b in range(len(null)):
        for a in range(len(chosen)):
            n, j = chosen[a, 0], chosen[a, 1]
            nx = c * facets.normals[j, 0] - s * facets.normals[j, 1]
            ny = s * facets.normals[j, 0] + c * facets.normals[j, 1]
            vx, vy = segment[1, n, 0] - segment[0, n, 0], segment[1, n, 1] - segment[0, n, 1]
            x, y = segment[0, n, 0] + t * vx - row[2], segment[0, n, 1] + t * vy - row[3]
            moments[b] += null[b, a] * (x * ny - y * nx)
            rates[b] += null[b, a] * (nx * vx + ny * vy)
    first, second = (moments[1], -moments[0]) if len(null) == 2 else (1.0, 0.0)
    weights = first * null[0, : len(chosen)]
    if len(null) == 2:
        weights += second * null[1, : len(chosen)]
    sign = 1.0 if weights.sum() > 0 else -1.0
    total = np.abs(weights).sum()
    if total <= ROUND:
        return False  # all lines of force meet: fewer contacts balance, and are a set of their own
    least = (sign * weights).min() / total
    row[11] = sign * (first * rates[0] + second * rates[1]) / total
    row[14] = min(least, -row[11])
    return least >= -TOUCH and row[11] <= ROUND
