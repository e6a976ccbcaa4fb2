"""Does the last knot hold the object at the goal, and is its pose seen by the fingers?  (Thesis 5.2.4)

Contacts (finger, facet) have gaps g(x, t) = n.R(t)^T (p - x) - d.  For weights lambda >= 0 with sum lambda n = 0, x drops
out of f(t) = sum lambda g = Re(exp(-i t) P) - E, and f(t) < 0 forbids the orientation t.  The extreme rays of these
weights (two antiparallel normals, or three that span the plane positively) decide:

first order   some f falls to either side of the goal: f'(0) <= -least and f'(0) >= least;
second order  f'(0) = 0 and f''(0) = -E < 0: three normals that meet.
"""

import itertools
from dataclasses import dataclass

import numpy as np
import shapely
from scipy.optimize import linprog

from expert.errors import SolverFailed
from expert.geometry.pose import Array, cross
from expert.verify.grasp.finger_path import Facets

TOUCHES = 1e-6
"""A finger within this relative distance of a facet touches it."""
LEAST = 1e-3
"""Least slope of f (relative lengths, sum lambda = 1), and least E for second order: below, closure is too weak to claim."""
FACET_ENDS = 1e-9

Contacts = list[tuple[int, int]]


@dataclass(frozen=True)
class Rays:
    """Weights (R, C) with sum 1 per row, their P (R,) complex, and E (R,)."""

    weights: Array
    P: np.ndarray
    E: Array

    @classmethod
    def of(cls, normals: Array, offsets: Array, points: Array) -> "Rays":
        """Of contacts with unit normals (C, 2), offsets (C,), at points (C, 2)."""
        rows = [*_pairs(normals), *_triples(normals)]
        weights = np.array(rows).reshape(-1, len(normals))
        n, p = normals @ [1, 1j], points @ [1, 1j]
        return cls(weights, weights @ (np.conj(n) * p), weights @ offsets)

    @property
    def slopes(self) -> Array:
        """f'(0) (R,)."""
        return self.P.imag


def _pairs(normals: Array) -> list[Array]:
    rows = []
    for i, j in itertools.combinations(range(len(normals)), 2):
        if abs(cross(normals[i], normals[j])) <= 1e-9 and normals[i] @ normals[j] < 0:
            rows.append(np.eye(len(normals))[[i, j]].sum(axis=0) / 2)
    return rows


def _triples(normals: Array) -> list[Array]:
    rows = []
    for ids in itertools.combinations(range(len(normals)), 3):
        a, b, c = normals[list(ids)]
        weights = np.array([cross(b, c), cross(c, a), cross(a, b)])
        weights *= np.sign(weights.sum())
        if weights.min() > 1e-9:
            row = np.zeros(len(normals))
            row[list(ids)] = weights / weights.sum()
            rows.append(row)
    return rows


def touching(facets: Facets, fingers: Array) -> Contacts:
    """Contacts of relative fingers (N, 2) with the object at the goal; a finger at a convex corner holds nothing."""
    found: Contacts = []
    for i, p in enumerate(fingers):
        along = ((p - facets.starts) * facets.tangents).sum(axis=1)
        off = facets.normals @ p - facets.offsets
        on = (np.abs(off) <= TOUCHES) & (along >= -FACET_ENDS) & (along <= facets.lengths + FACET_ENDS)
        touched = [int(j) for j in np.flatnonzero(on)]
        if len(touched) <= 1 or _join_in(facets, touched):
            found += [(i, j) for j in touched]
    return found


def _join_in(facets: Facets, touched: list[int]) -> bool:
    """Whether two touched facets meet at a reflex corner, or in one line."""
    i, j = touched[:2]
    corner = j if (i + 1) % len(facets.offsets) == j else i
    collinear = abs(cross(facets.normals[i], facets.normals[j])) <= 1e-9
    return bool(facets.reflex[corner] or collinear)


def form_closure(facets: Facets, fingers: Array, contacts: Contacts) -> int:
    """0: the object can move, to second order; 1: first-order form closure; 2: second-order form closure only."""
    if not contacts:
        return 0
    normals, rays = _rays(facets, fingers, contacts)
    if not _positively_span(normals):
        return 0
    if rays.slopes.max() >= LEAST and rays.slopes.min() <= -LEAST:
        return 1
    level = np.abs(rays.slopes) <= TOUCHES
    return 2 if bool((level & (rays.E >= LEAST)).any()) else 0


def _rays(facets: Facets, fingers: Array, contacts: Contacts) -> tuple[Array, Rays]:
    i, j = np.array(contacts).T
    normals = facets.normals[j]
    return normals, Rays.of(normals, facets.offsets[j], fingers[i])


def _positively_span(normals: Array) -> bool:
    """Whether every direction of the plane is a positive combination of the normals (C, 2)."""
    angles = np.sort(np.arctan2(normals[:, 1], normals[:, 0]))
    return bool(np.append(np.diff(angles), angles[0] + 2 * np.pi - angles[-1]).max() < np.pi - 1e-6)


def observability_rank(gradients: Array) -> int:
    """Rank of the proprioceptive sensor model (5.2 Definition 1) with gap gradients (C, 3).

    Rank 3: the grasp is observable (5.2 Definition 2, 5.2 Remark 3), which is first-order form closure (5.2 Remark 4,
    5.2 Corollary 1).

    Sensor i answers to first order with g_i . dq where that is negative (the gap closes), and with 0 otherwise.  Motions
    without any answer form the cone g_i . dq >= 0; the rank is 3 less the dimension that it spans.  That is the rank of
    the gradients which vanish on all of the cone: one linear program finds a motion that opens every gap that can open.
    """
    count = len(gradients)
    if count == 0:
        return 0
    opening = np.hstack([-gradients, np.eye(count)])  # opening_i <= g_i . dq
    cost = np.append(np.zeros(3), -np.ones(count))
    bounds = [(-1 / LEAST, 1 / LEAST)] * 3 + [(0, 1)] * count
    answer = linprog(cost, A_ub=opening, b_ub=np.zeros(count), bounds=bounds)
    if answer.status != 0:
        raise SolverFailed(f"linear program of the observability rank: {answer.message}")
    fixed = gradients[answer.x[3:] < 0.5]
    return int(np.linalg.matrix_rank(fixed, tol=LEAST)) if len(fixed) else 0


def gap_gradients(facets: Facets, fingers: Array, contacts: Contacts) -> Array:
    """Gradients (C, 3) of the gaps with respect to (x, y, theta) at the goal, relative lengths."""
    i, j = np.array(contacts, dtype=int).reshape(-1, 2).T
    return np.column_stack([-facets.normals[j], -cross(fingers[i], facets.normals[j])])


@dataclass(frozen=True)
class Isolation:
    """Within angle and distance of the goal, free configurations differ from it by at most turn and shift (relative)."""

    angle: float
    distance: float
    turn: float
    shift: float

    def holds_in(self, shift: float, low: float, high: float) -> bool:
        """Whether it speaks of all configurations within a shift of the goal and orientations from low to high."""
        angle = max(-low, high)
        return angle <= self.angle and shift + angle <= self.distance


NOT_ISOLATED = Isolation(0.0, 0.0, np.inf, np.inf)


def isolation(facets: Facets, vertices: Array, fingers: Array, contacts: Contacts) -> Isolation:
    """How well contacts in form closure single out the goal, given by how much they miss their facets.

    `distance` bounds shift + angle (fingers are at most about 1 from the reference point; the farthest one counts).
    """
    if form_closure(facets, fingers, contacts) == 0:
        return NOT_ISOLATED
    normals, rays = _rays(facets, fingers, contacts)
    i, j = np.array(contacts).T
    gaps = np.abs((normals * fingers[i]).sum(axis=1) - facets.offsets[j])
    loose = max(float(gaps.max()), 1e-9)
    ahead = _allowed(rays, loose, 1.0)
    back = _allowed(rays, loose, -1.0)
    turn = max(ahead[0], back[0])
    reach = max(1.0, float(np.linalg.norm(fingers, axis=1).max()))
    shift = _largest_shift(normals, 2 * loose + reach * turn)
    room = min(_room(vertices, fingers[f], [m for n, m in contacts if n == f]) for f in set(i.tolist()))
    return Isolation(min(ahead[1], back[1]), room / reach, turn, shift)


def _allowed(rays: Rays, loose: float, sign: float) -> tuple[float, float]:
    """Largest orientation on one side that all rays allow, and the orientation up to which that is the last one."""
    best = (np.inf, 0.0)
    rho, phi = np.abs(rays.P), np.angle(rays.P) * sign
    for r, f, e in zip(rho, phi, rays.E - loose, strict=True):
        if r <= 1e-12 or abs(e) >= r:
            continue  # allows every orientation, or none: then gaps as loose as this contradict the goal being free
        half = float(np.arccos(e / r))
        end = f + half
        if end >= 0 and f - half <= 1e-9 and end < best[0]:
            best = (end, f - half + 2 * np.pi)
    return best


def _largest_shift(normals: Array, bound: float) -> float:
    """Largest |x| with n . x <= bound for all normals."""
    largest = 0.0
    for a, b in itertools.combinations(normals, 2):
        if abs(cross(a, b)) > 1e-9:
            corner = np.linalg.solve(np.array([a, b]), [bound, bound])
            if (normals @ corner <= bound * (1 + 1e-9)).all():
                largest = max(largest, float(np.linalg.norm(corner)))
    return largest


def _room(vertices: Array, point: Array, touched: list[int]) -> float:
    """Distance of a contact point from the facets that it does not touch."""
    ends = np.stack([vertices, np.roll(vertices, -1, axis=0)], axis=1)
    others = shapely.linestrings(np.delete(ends, touched, axis=0))
    return float(shapely.distance(others, shapely.Point(point)).min())
