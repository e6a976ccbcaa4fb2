"""When and at what angle a set of contacts can close: the object's position eliminated by null vectors, compiled.

For every null vector lambda of the contacts' normals, sum lambda n = 0, the position drops out of the sum of gaps: with
complex numbers f = sum lambda g = Re(exp(-i t) P(s)) - E, P = sum lambda conj(n) p(s), E = sum lambda d.  On a segment of
the finger path P is linear in the fraction of it.

null vectors  contact sets                                      equations for (s, t)                     polynomial in s
one           n, -n;  three that span positively                |P| = E, t = arg P (largest f over t)    degree 2
two           n, n, -n;  four                                   Re(exp(-i t) P_k) = E_k for k = a, b     degree 4
"""

from typing import NamedTuple

import numba
import numpy as np

from expert.geometry.pose import Array
from expert.verify.grasp.finger_path import Facets
from expert.verify.grasp.unit_roots import one_sign, roots_in_unit
from expert.world.values import IntArray

PARALLEL = 1e-9
"""Normals whose cross product is below this are parallel."""
ROUND = 1e-9
"""Relative lengths and rates below this count as zero: contacts that neither close nor open along a segment make no event."""


class ContactSet(NamedTuple):
    """Finger and facet of each contact, (m,), and a basis (b, m) of {lambda: sum lambda n = 0}."""

    fingers: IntArray
    facets: IntArray
    balances: Array


class Segment(NamedTuple):
    """Fingers (N, 2) at its start, and their way to its end."""

    start: Array
    step: Array


class Reduced(NamedTuple):
    """f of one null vector: P at the segment's start, its change over the segment, and E."""

    P: complex
    change: complex
    E: float


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
def balances(normals: Array) -> Array:
    """Basis (m - rank, m) of {lambda: sum lambda n = 0} for normals (m, 2), entries up to 1."""
    m = len(normals)
    bi, bj, best = least_parallel(normals)
    if abs(best) <= PARALLEL:
        basis = np.zeros((m - 1, m))
        for k in range(1, m):
            basis[k - 1, k] = 1.0
            basis[k - 1, 0] = -(normals[0, 0] * normals[k, 0] + normals[0, 1] * normals[k, 1])
        return basis
    basis, count = np.zeros((m - 2, m)), 0
    for k in range(m):
        if k != bi and k != bj:
            row = basis[count]
            row[k] = 1.0
            row[bi] = -(normals[k, 0] * normals[bj, 1] - normals[k, 1] * normals[bj, 0]) / best
            row[bj] = -(normals[bi, 0] * normals[k, 1] - normals[bi, 1] * normals[k, 0]) / best
            row /= max(1.0, abs(row[bi]), abs(row[bj]))
            count += 1
    return basis


@numba.njit(cache=True)
def closing_poses(contacts: ContactSet, facets: Facets, segment: Segment) -> Array:
    """Fractions of a segment and angles (r, 2) at which contacts with one or two null vectors may close."""
    first = _reduced(contacts.balances[0], contacts, facets, segment)
    if len(contacts.balances) == 2:
        return _double(first, _reduced(contacts.balances[1], contacts, facets, segment))
    return _single(contacts.balances[0], first)


@numba.njit(cache=True)
def _reduced(balance: Array, contacts: ContactSet, facets: Facets, segment: Segment) -> Reduced:
    """f for one null vector (m,)."""
    P, change, E = 0j, 0j, 0.0
    for a in range(len(balance)):
        n, j, weight = contacts.fingers[a], contacts.facets[a], balance[a]
        conjugate = complex(facets.normals[j, 0], -facets.normals[j, 1])
        P += weight * conjugate * complex(segment.start[n, 0], segment.start[n, 1])
        change += weight * conjugate * complex(segment.step[n, 0], segment.step[n, 1])
        E += weight * facets.offsets[j]
    return Reduced(P, change, E)


@numba.njit(cache=True)
def _single(weights: Array, f: Reduced) -> Array:
    """(fraction, angle) rows where |P| falls to E > 0; none if the weights lambda (m,) are not positive."""
    if weights.min() <= PARALLEL or f.E <= 0:
        return np.empty((0, 2))
    total = weights.sum()
    P, change, E = f.P / total, f.change / total, f.E / total
    distance = np.array([_dot(P, P) - E * E, 2 * _dot(P, change), _dot(change, change)])
    roots = roots_in_unit(distance)
    poses, count = np.empty((len(roots), 2)), 0
    for fraction in roots:
        there = P + fraction * change
        if _dot(there, change) <= ROUND:
            poses[count] = fraction, np.arctan2(there.imag, there.real)
            count += 1
    return poses[:count]


@numba.njit(cache=True)
def _double(a: Reduced, b: Reduced) -> Array:
    """(fraction, angle) rows with Re(exp(-i t) P_a) = E_a and Re(exp(-i t) P_b) = E_b.

    Where P_a and P_b span the plane, exp(i t) = -i (E_a P_b - E_b P_a) / det(P_a, P_b) must be of length 1.
    """
    u0, u1 = a.E * b.P - b.E * a.P, a.E * b.change - b.E * a.change
    d0, d2 = _det(a.P, b.P), _det(a.change, b.change)
    d1 = _det(a.P, b.change) + _det(a.change, b.P)
    misfit = np.array([
        _dot(u0, u0) - d0 * d0,
        2 * _dot(u0, u1) - 2 * d0 * d1,
        _dot(u1, u1) - d1 * d1 - 2 * d0 * d2,
        -2 * d1 * d2,
        -d2 * d2,
    ])  # fmt: skip
    if one_sign(misfit):
        return np.empty((0, 2))
    roots = roots_in_unit(misfit)
    poses, count = np.empty((2 * len(roots), 2)), 0
    for fraction in roots:
        for angle in _angles(a.P + fraction * a.change, a.E, b.P + fraction * b.change, b.E):
            poses[count] = fraction, angle
            count += 1
    return poses[:count]


@numba.njit(cache=True)
def _angles(Pa: complex, Ea: float, Pb: complex, Eb: float) -> Array:
    """Angles (0, 1 or 2) at which both equations hold."""
    det = _det(Pa, Pb)
    if abs(det) > 1e-6:
        direction = -1j * (Ea * Pb - Eb * Pa) / det
        return np.array([np.arctan2(direction.imag, direction.real)])
    P, E = (
        (Pb, Eb) if abs(Pb) > abs(Pa) else (Pa, Ea)
    )  # parallel: the longer one decides, with both its angles
    if abs(P) <= ROUND or abs(E) > abs(P) * (1 + 1e-6):
        return np.empty(0)
    turn = np.arccos(min(max(E / abs(P), -1.0), 1.0))
    middle = np.arctan2(P.imag, P.real)
    return np.array([middle - turn, middle + turn])


@numba.njit(cache=True)
def _dot(a: complex, b: complex) -> float:
    return a.real * b.real + a.imag * b.imag


@numba.njit(cache=True)
def _det(a: complex, b: complex) -> float:
    return a.real * b.imag - a.imag * b.real
