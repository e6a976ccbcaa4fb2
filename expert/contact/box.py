"""Where the fingers of a mode sequence may be: boxes of rho, free regions outside the object, walls (Thesis 3-CT7)."""

from typing import NamedTuple

import numpy as np

from expert.contact.scaled import ScaledTask
from expert.contact.sequence import Sequence
from expert.geometry.pose import Array
from expert.numeric.qp import compiled, inlined
from expert.world.values import IntArray

FAR = 10.0
"""Free fingers are sought within this distance of the workspace [L]."""


class Box(NamedTuple):
    """A mode sequence with rho in lo <= rho <= hi; assigned (S, C): region of a free finger (3-CT7), -1 where none is imposed yet."""

    sequence: Sequence
    lo: Array
    hi: Array
    assigned: IntArray


@inlined
def standing_rows(scaled: ScaledTask, box: Box, width: int) -> tuple[Array, Array]:
    """Rows A z >= b of `width` columns: rho in the box, free fingers clear of walls and in their assigned regions (3-CT7)."""
    s, lo, hi, assigned = box
    loose = s.free >= 0
    W, H = len(scaled.walls), scaled.region.shape[2]
    m = 2 * lo.size + loose.sum() * W + (loose & (assigned >= 0)).sum() * H
    A, b = np.zeros((m, width)), np.zeros(m)
    for k in range(lo.size):
        A[2 * k, k], b[2 * k] = 1.0, lo[k]
        A[2 * k + 1, k], b[2 * k + 1] = -1.0, -hi[k]
    i = 2 * lo.size
    for t in range(s.free.shape[0]):
        for c in range(s.free.shape[1]):
            v = s.free[t, c]
            if v < 0:
                continue
            for w in range(W):
                A[i, v], A[i, v + 1], b[i] = scaled.walls[w, 0], scaled.walls[w, 1], scaled.walls[w, 2]
                i += 1
            if assigned[t, c] >= 0:
                for h in range(H):
                    row = scaled.region[t, assigned[t, c], h]
                    A[i, v], A[i, v + 1], b[i] = -row[0], -row[1], -row[2]
                    i += 1
    return A, b


@compiled
def least_over_box(scaled: ScaledTask, lo: Array, hi: Array, z: Array, slope: Array) -> float:
    """min over the box of slope.(x - z): what a convex function with this gradient at z can still fall by."""
    fall = 0.0
    for k in range(z.size):
        d = (k - lo.size) % 2
        low = lo[k] if k < lo.size else scaled.workspace[0, d] - FAR
        high = hi[k] if k < lo.size else scaled.workspace[1, d] + FAR
        fall += min(slope[k] * (low - z[k]), slope[k] * (high - z[k]))
    return fall


@inlined
def worst_intrusion(scaled: ScaledTask, box: Box, z: Array) -> tuple[int, int, float]:
    """Step, finger and depth of the free finger deepest outside all regions; depth 0: all are outside the object."""
    worst_t, worst_c, worst = -1, -1, 1e-9
    S, C = box.assigned.shape
    for t in range(S):
        for c in range(C):
            v = box.sequence.free[t, c]
            if v >= 0 and box.assigned[t, c] < 0:
                _, depth = nearest_region(scaled, t, z[v], z[v + 1])
                if depth > worst:
                    worst_t, worst_c, worst = t, c, depth
    return worst_t, worst_c, worst if worst_t >= 0 else 0.0


@compiled
def nearest_region(scaled: ScaledTask, t: int, x: float, y: float) -> tuple[int, float]:
    """Region that a point misses by least, and by how much (<= 0: inside)."""
    best, least = -1, np.inf
    for r in range(scaled.region.shape[1]):
        miss = -np.inf
        for h in range(scaled.region.shape[2]):
            row = scaled.region[t, r, h]
            miss = max(miss, row[0] * x + row[1] * y - row[2])
        if miss < least:
            best, least = r, miss
    return best, least
