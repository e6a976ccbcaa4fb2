"""Critical contact sets of moving fingers on a polygon: compiled loops over contacts and path segments.

A contact (finger i, facet j) at configuration (x, t) and parameter s has the gap g = n.R(t)^T (p(s) - x) - d >= 0.  At a
local maximum of s over the free configurations some contacts with g = 0 have lambda > 0, sum lambda grad_q g = 0 and
sum lambda dg/ds < 0; a minimal such set has two to four members.  `expert.verify.grasp.closing_equations` gives s and t.
"""

from typing import NamedTuple

import numba
import numpy as np

from expert.geometry.pose import Array
from expert.verify.grasp.closing_equations import (
    PARALLEL,
    ROUND,
    ContactSet,
    Segment,
    balances,
    closing_poses,
    least_parallel,
    spans,
)
from expert.verify.grasp.finger_path import Facets
from expert.world.values import IntArray

TOUCH = 1e-7
"""A contact may miss its facet, or another finger enter the object, by this relative length, and a weight be so negative."""
EVENT = np.dtype([
    ("segment", np.int64),
    ("fraction", np.float64),  # of the segment
    ("x", np.float64),
    ("y", np.float64),
    ("angle", np.float64),
    ("slides", np.bool_),  # along all facets touched, which are parallel:
    ("slide_x", np.float64),  # the direction, and from where to where
    ("slide_y", np.float64),
    ("slide_from", np.float64),
    ("slide_to", np.float64),
    ("count", np.int64),  # of contacts
    ("contacts", np.int64, (4,)),
    ("clear", np.float64),  # by how much weights, closing rate and, where nothing slides, places keep their limits
])  # fmt: skip
"""The object vanishes between contacts here."""


class Candidates(NamedTuple):
    """Contacts (C, 2): finger, facet; which of them can be touched at once (C, C); facets; knots (K, N, 2)."""

    contacts: IntArray
    compatible: np.ndarray
    facets: Facets
    knots: Array


class Place(NamedTuple):
    """A configuration, and the direction in which the object can slide there; none: zero."""

    x: float
    y: float
    angle: float
    slide_x: float
    slide_y: float


@numba.njit(cache=True)
def closing_contacts(candidates: Candidates, events: np.ndarray) -> int:
    """Fill `events` (EVENT) with every configuration at which a minimal contact set closes; returns how many.

    Fingers that take no part are not looked at.  As many events as there are places may mean that some are missing.
    """
    count = 0
    for first in range(len(candidates.compatible)):
        count = closing_with(candidates, first, events, count)
    return count


@numba.njit(cache=True)
def closing_with(candidates: Candidates, first: int, events: np.ndarray, count: int) -> int:
    """The same for sets whose first contact this is, after so many events that are there; returns how many there are then."""
    compatible = candidates.compatible
    ids = np.empty(4, np.int64)
    ids[0] = first
    for b in np.flatnonzero(compatible[first]):
        if b <= first:
            continue
        ids[1] = b
        count = _append(ids[:2], candidates, events, count)
        for c in np.flatnonzero(compatible[first] & compatible[b]):
            if c <= b:
                continue
            ids[2] = c
            count = _append(ids[:3], candidates, events, count)
            for d in np.flatnonzero(compatible[first] & compatible[b] & compatible[c]):
                if d > c:
                    ids[3] = d
                    count = _append(ids, candidates, events, count)
    return count


@numba.njit(cache=True)
def _append(ids: IntArray, candidates: Candidates, events: np.ndarray, count: int) -> int:
    """Append the events of the contacts `ids`, on all segments, to the first `count`; returns the new count."""
    facets, knots = candidates.facets, candidates.knots
    touched = candidates.contacts[ids, 1]
    normals = facets.normals[touched]
    if not spans(normals):
        return count
    basis = balances(normals)
    if len(basis) == 0 or len(basis) > 2:
        return count
    contacts = ContactSet(candidates.contacts[ids, 0], touched, basis)
    for k in range(len(knots) - 1):
        segment = Segment(knots[k], knots[k + 1] - knots[k])
        for fraction, angle in closing_poses(contacts, facets, segment):
            if count == len(events):
                return count
            event = events[count]
            event.segment, event.fraction, event.angle = k, fraction, angle
            if _closes(contacts, facets, segment, event):
                event.count = len(ids)
                event.contacts[: len(ids)] = ids
                count += 1
    return count


@numba.njit(cache=True)
def _closes(contacts: ContactSet, facets: Facets, segment: Segment, event: np.record) -> bool:
    """Whether all contacts touch, balance and close at the event's fraction and angle; writes where to the event."""
    fingers = segment.start + event.fraction * segment.step
    place, missed = _place(contacts, facets, fingers, event.angle)
    least, rate = _balance(contacts, facets, segment, event.fraction, place)
    low, high, inside = _stretch(contacts, facets, fingers, place)
    slides = place.slide_x != 0.0 or place.slide_y != 0.0
    event.x, event.y = place.x, place.y
    event.slides, event.slide_x, event.slide_y = slides, place.slide_x, place.slide_y
    event.slide_from, event.slide_to = low, high
    event.clear = min(least, -rate) if slides else min(least, -rate, inside)
    on_facets = low <= high if slides else inside >= -TOUCH
    return missed <= TOUCH and least >= -TOUCH and rate <= ROUND and on_facets


@numba.njit(cache=True)
def _place(contacts: ContactSet, facets: Facets, fingers: Array, angle: float) -> tuple[Place, float]:
    """Where all contacts touch, and the largest distance by which one of them does not."""
    m = len(contacts.facets)
    c, s = np.cos(angle), np.sin(angle)
    world, right = np.empty((m, 2)), np.empty(m)
    for a in range(m):
        n, j = contacts.fingers[a], contacts.facets[a]
        world[a, 0] = c * facets.normals[j, 0] - s * facets.normals[j, 1]
        world[a, 1] = s * facets.normals[j, 0] + c * facets.normals[j, 1]
        right[a] = world[a, 0] * fingers[n, 0] + world[a, 1] * fingers[n, 1] - facets.offsets[j]
    bi, bj, best = least_parallel(world)
    if abs(best) <= PARALLEL:
        x, y = right[0] * world[0, 0], right[0] * world[0, 1]
        place = Place(x, y, angle, -world[0, 1], world[0, 0])
    else:
        x = (right[bi] * world[bj, 1] - right[bj] * world[bi, 1]) / best
        y = (world[bi, 0] * right[bj] - world[bj, 0] * right[bi]) / best
        place = Place(x, y, angle, 0.0, 0.0)
    return place, np.abs(world[:, 0] * x + world[:, 1] * y - right).max()


@numba.njit(cache=True)
def _stretch(
    contacts: ContactSet, facets: Facets, fingers: Array, place: Place
) -> tuple[float, float, float]:
    """From where to where the object can slide with every contact on its facet; at the place itself, how far from the ends."""
    c, s = np.cos(place.angle), np.sin(place.angle)
    low, high, inside = -np.inf, np.inf, np.inf
    for a in range(len(contacts.facets)):
        n, j = contacts.fingers[a], contacts.facets[a]
        tangent, start, length = facets.tangents[j], facets.starts[j], facets.lengths[j]
        tx, ty = c * tangent[0] - s * tangent[1], s * tangent[0] + c * tangent[1]
        along = tx * (fingers[n, 0] - place.x) + ty * (fingers[n, 1] - place.y)
        along -= tangent[0] * start[0] + tangent[1] * start[1]
        inside = min(inside, along, length - along)
        if tx * place.slide_x + ty * place.slide_y > 0:  # along falls as the object slides on
            low, high = max(low, along - length), min(high, along)
        else:
            low, high = max(low, -along), min(high, length - along)
    return low - TOUCH, high + TOUCH, inside


@numba.njit(cache=True)
def _balance(
    contacts: ContactSet, facets: Facets, segment: Segment, fraction: float, place: Place
) -> tuple[float, float]:
    """Of lambda with sum lambda grad g = 0 and sum |lambda| = 1: its least entry, and the rate sum lambda dg/ds.

    Infinite where all lines of force meet: fewer contacts balance, and are a set of their own.
    """
    c, s = np.cos(place.angle), np.sin(place.angle)
    basis = contacts.balances
    moments, rates = np.zeros(2), np.zeros(2)
    for a in range(len(contacts.facets)):
        n, j = contacts.fingers[a], contacts.facets[a]
        nx = c * facets.normals[j, 0] - s * facets.normals[j, 1]
        ny = s * facets.normals[j, 0] + c * facets.normals[j, 1]
        vx, vy = segment.step[n, 0], segment.step[n, 1]
        x, y = segment.start[n, 0] + fraction * vx - place.x, segment.start[n, 1] + fraction * vy - place.y
        for b in range(len(basis)):
            moments[b] += basis[b, a] * (x * ny - y * nx)
            rates[b] += basis[b, a] * (nx * vx + ny * vy)
    weights, rate = basis[0].copy(), rates[0]
    if len(basis) == 2:
        weights = moments[1] * basis[0] - moments[0] * basis[1]
        rate = moments[1] * rates[0] - moments[0] * rates[1]
    total = np.abs(weights).sum()
    if total <= ROUND:
        return -np.inf, np.inf
    sign = 1.0 if weights.sum() > 0 else -1.0
    return (sign * weights).min() / total, sign * rate / total
