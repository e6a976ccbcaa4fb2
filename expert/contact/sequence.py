"""One mode sequence: its variables z (rho per contact interval, positions of free fingers) and its smoothing cost."""

from typing import NamedTuple

import numpy as np

from expert.contact.scaled import ScaledTask
from expert.geometry.pose import Array
from expert.numeric.qp import INFEASIBLE, SOLVED, compiled, solve_qp
from expert.world.values import IntArray

FAR = 10.0
"""Free fingers are sought within this distance of the workspace [L]."""
FLAT = 1e-8
"""Curvature, relative to the smoothing weight, that holds directions without any cost near a reference."""


class Sequence(NamedTuple):
    """Modes (S, C) of the first S steps, numbered variables.

    interval (S, C): index of the contact interval or -1; free (S, C): first of two variables of a free position or -1 (a
    finger that never touches is parked and has none).  facet, finger, lo, hi (K,) by interval; size: number of variables.
    offset (S, C, 2) and map (S, C, 2, n): positions offset + map z.  Q, q, q0: smoothing cost z'Qz/2 + q'z + q0.
    """

    modes: IntArray
    interval: IntArray
    free: IntArray
    facet: IntArray
    lo: Array
    hi: Array
    size: int
    offset: Array
    map: Array
    Q: Array
    q: Array
    q0: float
    reference: Array


@compiled
def sequence_of(scaled: ScaledTask, modes: IntArray) -> Sequence:
    """Number the variables and add up the smoothing cost (backward second differences from the third step on)."""
    S, C = modes.shape
    interval, free = np.full((S, C), -1), np.full((S, C), -1)
    facet, lo, hi = np.empty(S * C, np.int64), np.zeros(S * C), np.ones(S * C)
    K = 0
    for c in range(C):
        for t in range(S):
            f = modes[t, c]
            if f >= 0:
                if t == 0 or modes[t - 1, c] != f:
                    facet[K] = f
                    K += 1
                interval[t, c] = K - 1
                lo[K - 1] = max(lo[K - 1], scaled.low[t, f])
                hi[K - 1] = min(hi[K - 1], scaled.high[t, f])
    n = K
    for c in range(C):
        if np.isnan(scaled.parking[0]) or (modes[:, c] >= 0).any():
            for t in range(S):
                if modes[t, c] < 0:
                    free[t, c] = n
                    n += 2
    offset, map = np.zeros((S, C, 2)), np.zeros((S, C, 2, n))
    for t in range(S):
        for c in range(C):
            f = modes[t, c]
            if f >= 0:
                offset[t, c] = scaled.centre[t] + scaled.arm[t, f]
                map[t, c, :, interval[t, c]] = scaled.edge[t, f]
            elif free[t, c] >= 0:
                map[t, c, 0, free[t, c]] = 1.0
                map[t, c, 1, free[t, c] + 1] = 1.0
            else:
                offset[t, c] = scaled.parking
    Q, q, q0 = np.zeros((n, n)), np.zeros(n), 0.0
    row = np.zeros(n)
    for c in range(C):
        for t in range(2, S):
            for d in range(2):
                constant = offset[t, c, d] - 2 * offset[t - 1, c, d] + offset[t - 2, c, d]
                for k in range(n):
                    row[k] = map[t, c, d, k] - 2 * map[t - 1, c, d, k] + map[t - 2, c, d, k]
                weight = 2 * scaled.acceleration_weight
                for i in range(n):
                    if row[i] != 0.0:
                        q[i] += weight * row[i] * constant
                        for j in range(n):
                            Q[i, j] += weight * row[i] * row[j]
                q0 += 0.5 * weight * constant * constant
    reference = _reference(scaled, modes, free, lo[:K], hi[:K], n)
    return Sequence(modes, interval, free, facet[:K], lo[:K], hi[:K], n, offset, map, Q, q, q0, reference)


@compiled
def _reference(scaled: ScaledTask, modes: IntArray, free: IntArray, lo: Array, hi: Array, n: int) -> Array:
    """Where flat directions are held: mid-range rho; free fingers beside the middle of the nearest facet they touch."""
    z = np.zeros(n)
    z[: lo.size] = 0.5 * (lo + hi)
    S, C = modes.shape
    for c in range(C):
        for t in range(S):
            if free[t, c] >= 0:
                nearest = -1
                for s in range(S):
                    if modes[s, c] >= 0 and (nearest < 0 or abs(s - t) < abs(nearest - t)):
                        nearest = s
                f = max(modes[nearest, c], 0)
                point = (
                    scaled.centre[t] + scaled.arm[t, f] + 0.5 * scaled.edge[t, f] - 0.1 * scaled.normal[t, f]
                )
                z[free[t, c]], z[free[t, c] + 1] = point[0], point[1]
    return z


@compiled
def smoothing(sequence: Sequence, z: Array) -> float:
    """Smoothing cost at z."""
    return float(0.5 * z @ (sequence.Q @ z) + sequence.q @ z + sequence.q0)


@compiled
def standing_rows(
    scaled: ScaledTask, sequence: Sequence, lo: Array, hi: Array, assigned: IntArray, width: int
) -> tuple[Array, Array]:
    """Rows A z >= b of `width` columns: rho in [lo, hi], free fingers clear of walls and in their assigned regions.

    assigned (S, C): region of a free finger (Thesis 3-CT7), -1 where none is imposed yet.
    """
    S, C = sequence.modes.shape
    K, W, H = lo.size, len(scaled.walls), scaled.region.shape[2]
    loose = assigned_count = 0
    for t in range(S):
        for c in range(C):
            if sequence.free[t, c] >= 0:
                loose += 1
                assigned_count += assigned[t, c] >= 0
    m = 2 * K + loose * W + assigned_count * H
    A, b = np.zeros((m, width)), np.zeros(m)
    for k in range(K):
        A[2 * k, k], b[2 * k] = 1.0, lo[k]
        A[2 * k + 1, k], b[2 * k + 1] = -1.0, -hi[k]
    i = 2 * K
    for t in range(S):
        for c in range(C):
            v = sequence.free[t, c]
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
def least_over_box(scaled: ScaledTask, z: Array, slope: Array, lo: Array, hi: Array) -> float:
    """min over the box of slope.(x - z): what a convex function with this gradient at z can still fall by."""
    fall = 0.0
    for k in range(z.size):
        d = (k - lo.size) % 2
        low = lo[k] if k < lo.size else scaled.workspace[0, d] - FAR
        high = hi[k] if k < lo.size else scaled.workspace[1, d] + FAR
        fall += min(slope[k] * (low - z[k]), slope[k] * (high - z[k]))
    return fall


@compiled
def least_smoothing(scaled: ScaledTask, modes: IntArray, assigned: IntArray) -> tuple[float, int]:
    """Lower bound of the smoothing cost of one finger's modes (S, 1) with its regions (inf: no room), and the step to
    branch on: where the finger is deepest inside the object, -1 if nowhere."""
    s = sequence_of(scaled, modes)
    if (s.lo > s.hi).any():
        return np.inf, -1
    if s.size == 0:
        return s.q0, -1
    A, b = standing_rows(scaled, s, s.lo, s.hi, assigned, s.size)
    ridge = FLAT * (1 + scaled.acceleration_weight)
    H = s.Q + ridge * np.eye(s.size)
    status, z, u = solve_qp(H, s.q - ridge * s.reference, A, b, np.int64(0), scaled.iterations)
    slope, bound = s.Q @ z + s.q, smoothing(s, z)
    if status == INFEASIBLE:
        slope[:], bound = 0.0, 0.0
    for i in range(b.size):
        weight = max(u[i], 0.0)
        bound += weight * b[i]
        for j in range(z.size):
            slope[j] -= weight * A[i, j]
            if status == SOLVED:
                bound -= weight * A[i, j] * z[j]
    if status == INFEASIBLE:
        z[:] = 0.0
    bound += least_over_box(scaled, z, slope, s.lo, s.hi)
    if status == INFEASIBLE and bound > 1e-12 * np.abs(u).max() * (1 + np.abs(b).max()) * b.size:
        return np.inf, -1
    if status != SOLVED:
        return 0.0, -1
    t, _, _ = worst_intrusion(scaled, s, z, assigned)
    return max(0.0, bound), t


@compiled
def worst_intrusion(
    scaled: ScaledTask, sequence: Sequence, z: Array, assigned: IntArray
) -> tuple[int, int, float]:
    """Step, finger and depth of the free finger deepest outside all regions; depth 0: all are outside the object."""
    worst_t, worst_c, worst = -1, -1, 1e-9
    S, C = sequence.modes.shape
    for t in range(S):
        for c in range(C):
            v = sequence.free[t, c]
            if v >= 0 and assigned[t, c] < 0:
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
