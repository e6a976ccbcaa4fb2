"""Sets of MIP1 (Thesis 5.1.4, 5.1.5) for one object and one choice of slices; relative lengths, the start at the origin."""

import itertools
from dataclasses import dataclass

import numpy as np

from expert.geometry.convex import free_regions
from expert.geometry.cover import half_planes
from expert.geometry.polygon import facet_frames, facets, reflex_vertices
from expert.geometry.pose import Array, perpendicular
from expert.loops.normals import rays
from expert.loops.swept import SweptGeometry

SPANNING = 0.05
"""Normals of limit contacts positively span the plane with weights of at least this (they sum to 1)."""
INSET = 0.02
"""Limit contacts keep this share of a facet from its convex ends, where the object could turn around the finger."""


def limit_contacts(vertices: Array, count: int) -> Array:
    """The set L_O of 5-CT8: weights (c, n, f) >= 0 of contacts of fingers n with facets f, those of two opposite facets or of
    three whose normals positively span the plane: sum_nf w_nf nu_f = 0 and sum_nf w_nf = 1.

    A finger touches two facets at once at the reflex corner between them.
    """
    nu = -facet_frames(vertices)[0]
    reflex = reflex_vertices(vertices)
    contacts = []
    for size in (2, 3):
        for touched in itertools.combinations(range(len(nu)), size):
            w = _spanning_weights(nu[list(touched)])
            if w is None:
                continue
            for n in itertools.product(range(count), repeat=size):
                if _possible(n, touched, reflex):
                    contacts.append(np.zeros((count, len(nu))))
                    contacts[-1][list(n), list(touched)] = w
    return np.array(contacts).reshape(-1, count, len(nu))


def _spanning_weights(nu: Array) -> Array | None:
    """Positive w with sum 1 and w nu = 0 for two or three normals (k, 2), if there are any and they are unique."""
    return next((w for w in rays(nu) if w.min() >= SPANNING), None)


def _possible(n: tuple[int, ...], touched: tuple[int, ...], reflex: np.ndarray) -> bool:
    """Whether fingers n can touch these facets at once."""
    for (i, f), (j, g) in itertools.combinations(zip(n, touched, strict=True), 2):
        corner = g if g == f + 1 else f if (f, g) == (0, len(reflex) - 1) else None
        if i == j and (corner is None or not reflex[corner]):
            return False
    return len(set(n)) > 1


@dataclass(frozen=True)
class SlicedObject:
    """What MIP1 knows.  Index legend: s slice, i piece, e its edge, r region, h its half-plane, f facet.

    angles (s,) ascending, angles[start] = 0.  pieces A (i, e, 2), b (i, e), eroded; meeting (i, j): whether pieces overlap.
    contacts (c, n, f): `limit_contacts`.  regions A (r, h, 2), b (s, r, h): with clearance at the start alone, fingers touch the object elsewhere.
    ends (f, 2, 2), nu (f, 2) outward normals, along (f, 2): where on a facet, from 0 to 1, limit contacts may be.
    """

    angles: Array
    start: int
    piece_A: Array
    piece_b: Array
    meeting: np.ndarray
    region_A: Array
    region_b: Array
    ends: Array
    nu: Array
    along: Array
    contacts: Array
    clearance: float

    @classmethod
    def of(cls, vertices: Array, angles: Array, clearance: float, count: int) -> "SlicedObject":
        """Object (V, 2), relative.  Slices at `angles` [rad], ascending, 0 among them."""
        swept = SweptGeometry(vertices, clearance)
        piece_A, piece_b = _stacked([half_planes(piece) for piece in swept.pieces])
        regions = free_regions(vertices)
        region_A, elsewhere = _stacked([(r.A, r.b) for r in regions])
        _, at_start = _stacked([(r.A, swept.cleared(r, clearance).b) for r in regions])
        start = int(np.flatnonzero(angles == 0)[0])
        inward, _ = facet_frames(vertices)
        reflex = reflex_vertices(vertices)
        return cls(
            angles=angles,
            start=start,
            piece_A=piece_A,
            piece_b=piece_b - clearance,
            meeting=swept.meeting,
            region_A=region_A,
            region_b=np.array([at_start if s == start else elsewhere for s in range(len(angles))]),
            ends=np.stack(facets(vertices), axis=1),
            nu=-inward,
            along=np.column_stack(
                [np.where(reflex, 0.0, INSET), np.where(np.roll(reflex, -1), 1.0, 1 - INSET)]
            ),
            contacts=limit_contacts(vertices, count),
            clearance=clearance,
        )

    @property
    def shape(self) -> tuple[int, int, int, int]:
        """Numbers of slices, pieces, regions and facets."""
        return len(self.angles), len(self.piece_b), len(self.region_A), len(self.nu)

    def turning(self, rotations: Array) -> Array:
        """(s, c, n, 2): d/dtheta of sum_nf w_nf nu_f . (p_n - q), as coefficients of p, at slices with these rotations (s, 2, 2).

        The sum is the room that the touched facets leave: zero where they touch, negative where they cannot all be free.
        """
        return np.einsum("cnf,sde,fe->scnd", self.contacts, rotations, perpendicular(self.nu))


def _stacked(sets: list[tuple[Array, Array]]) -> tuple[Array, Array]:
    """Half-planes of several sets in arrays (k, h, 2), (k, h); the last one of a shorter set is repeated."""
    most = max(len(b) for _, b in sets)
    index = [np.minimum(np.arange(most), len(b) - 1) for _, b in sets]
    A = np.array([A[k] for (A, _), k in zip(sets, index, strict=True)])
    return A, np.array([b[k] for (_, b), k in zip(sets, index, strict=True)])
