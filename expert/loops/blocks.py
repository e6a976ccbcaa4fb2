"""What a ring of point obstacles must do to cage an object: one block for each equation (Thesis 5.1, 5.2, mended).

Index legend: n element of the ring (a finger, or a point of a wall), the next one after the last is the first; r region;
keys (i, j): exit piece i of n meets entry piece j of n + 1; pairs (i, j): entry piece i and exit piece j of one element.

p[n]        where element n is                      H[n, key]       1 iff these pieces meet
R[n, r]     1 iff n is in region r                  W[n, r, pair]   transport: 1 iff n is in r and has this pair
"""

from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np

from expert.geometry.convex import Region
from expert.geometry.pose import Array
from expert.loops.swept import FARTHEST, HalfPlanes
from expert.mip.affine import Affine, Constraint
from expert.mip.linear import LinearModel

MOST_TURNS = 2
"""Full turns that the direction of the object makes at most between two elements."""
ANGLE_MARGIN = 1e-3
"""[rad]"""
Pairs = Sequence[tuple[int, int]]
Part = Literal["entry", "exit", "both"]


def ahead(x: Affine) -> Affine:
    """Entry n of the result is entry n + 1 of x, cyclically."""
    return x[np.roll(np.arange(len(x)), -1)]


def behind(x: Affine) -> Affine:
    """Entry n of the result is entry n - 1 of x, cyclically."""
    return x[np.roll(np.arange(len(x)), 1)]


def shares(m: LinearModel, whole: Affine, choice: Affine, bound: float) -> Affine:
    """Parts (..., c, 2) of whole (..., 2), one for each entry of choice (..., c): a hull, once each is 0 where its choice is."""
    parts = m.variables((*choice.shape, 2), -bound, bound)
    m.add(whole == parts.sum(axis=-2))
    return parts


def inside(parts: Affine, choice: Affine, sets: Sequence[HalfPlanes]) -> Constraint:
    """part_c in choice_c times {x : A_c x <= b_c}, for parts (..., c, 2) and choice (..., c): one row for each half-plane."""
    A, b = (np.concatenate(side) for side in zip(*sets, strict=True))
    c = np.repeat(np.arange(len(sets)), [len(b) for _, b in sets])
    return (A * parts[..., c, :]).sum(axis=-1) <= b * choice[..., c]


def non_penetration(m: LinearModel, p: Affine, R: Affine, regions: Sequence[Region]) -> Affine:
    """5-CT6: R[n, r] = 1 => A_r p_n <= b_r.  Returns the share s (n, r, 2) of p in each region."""
    s = shares(m, p, R, FARTHEST)
    m.add(s <= FARTHEST * R[..., None], -s <= FARTHEST * R[..., None])
    for r, region in enumerate(regions):
        m.add(region.b[:, None] * R[:, r] >= region.A @ s[:, r].T)
    return s


def intersections(
    m: LinearModel, p: Affine, H: Affine, overlaps: Sequence[HalfPlanes], apart: np.ndarray
) -> None:
    """5-CT1, 5-CT9, 5-CT10, 5-CT11, 5-CT12, 5-CT13: H[n, key] = 1 => p_n - p_n+1 in K_key: the pieces overlap over a whole range of orientations.

    apart (n,): the elements that differ from their next one; the others are one wall.
    """
    d = shares(m, p - ahead(p), H, 2 * FARTHEST)
    for k, (A, b) in enumerate(overlaps):
        m.add(b[:, None] * H[apart, k] >= A @ d[apart, k].T)


def loop_closure(m: LinearModel, H: Affine, keys: Pairs, W: Affine, pairs: Pairs) -> None:
    """5-CT3, 5-CT4: the pieces that meet are those by which the loop leaves and enters each element."""
    exits, entries = np.array(keys).T
    enters, leaves = np.array(pairs).T
    used = W.sum(axis=1)
    for piece in range(int(max(exits.max(), entries.max(), enters.max(), leaves.max())) + 1):
        m.add(H[:, exits == piece].sum(axis=1) == used[:, leaves == piece].sum(axis=1))
        m.add(behind(H)[:, entries == piece].sum(axis=1) == used[:, enters == piece].sum(axis=1))


def object_enclosing(m: LinearModel, W: Affine, pairs: Pairs, directions: Array) -> None:
    """5-CT5: winding number one about the start, from the directions (r, piece) [rad] in which each piece lies, seen from there."""
    enters, leaves = np.array(pairs).T
    chosen = W.reshape(len(W), -1)
    into, out = (directions[:, piece].ravel() for piece in (enters, leaves))
    turns = m.variables((len(W),), -MOST_TURNS, MOST_TURNS, integral=True)
    gap = ahead(chosen) @ into - chosen @ out + 2 * np.pi * turns
    m.add(gap <= np.pi - ANGLE_MARGIN, -gap <= np.pi - ANGLE_MARGIN, turns.sum(axis=0) == 1)


def fill(
    m: LinearModel,
    p: Affine,
    W: Affine,
    pairs: Pairs,
    hub: int,
    common: Mapping[tuple[int, int], HalfPlanes],
) -> None:
    """5-CT7, 5-CT8: each triangle of the loop has a point y in the obstacles of its corners: p_n - y in both pieces of n.

    common: points of the object that are in pieces i and j at all orientations of a range.
    """
    for triangle in triangles(len(p), hub):
        y = m.variables((2,), -2 * FARTHEST, 2 * FARTHEST)
        for n, part in triangle:
            used = W[n].sum(axis=0)
            f = shares(m, p[n] - y, used, 2 * FARTHEST)
            met = [{"entry": (i, i), "exit": (j, j), "both": (i, j)}[part] for i, j in pairs]
            m.add(inside(f, used, [common[pair] for pair in met]))


def triangles(count: int, hub: int) -> list[list[tuple[int, Part]]]:
    """Elements and their pieces that share a point where the loop is filled.

    Three and more elements: a fan about element `hub`.  Two: the loop entry 0, exit 0, entry 1, exit 1 is cut along the
    exits (hub 0) or along the entries (hub 1).
    """
    if count == 2:
        part: Part = "entry" if hub else "exit"
        return [[(0, "both"), (1, part)], [(1, "both"), (0, part)]]
    corners = [(hub % count, (hub + t) % count, (hub + t + 1) % count) for t in range(1, count - 1)]
    return [[(c, "both") for c in corner] for corner in corners]
