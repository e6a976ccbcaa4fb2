"""One mode sequence: its variables z (rho per contact interval, positions of free fingers) and its smoothing cost."""

from typing import NamedTuple

import numpy as np

from expert.contact.scaled import ScaledTask
from expert.contact.steps import Stance
from expert.geometry.pose import Array
from expert.numeric.qp import compiled, inlined
from expert.world.values import IntArray


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
    interval, facet = intervals_of(modes)
    lo, hi = ranges_of(scaled, modes, interval, facet.size)
    free, n = free_variables(scaled, modes, facet.size)
    offset, map = positions_of(scaled, modes, interval, free, n)
    Q, q, q0 = smoothing_form(scaled, offset, map)
    reference = _reference(scaled, modes, free, lo, hi, n)
    return Sequence(modes, interval, free, facet, lo, hi, n, offset, map, Q, q, q0, reference)


@inlined
def intervals_of(modes: IntArray) -> tuple[IntArray, IntArray]:
    """Contact interval (S, C) of each step and finger or -1, and the facet (K,) of each interval: rho is one number in it (3-CT5)."""
    S, C = modes.shape
    interval, facet = np.full((S, C), -1), np.empty(S * C, np.int64)
    K = 0
    for c in range(C):
        for t in range(S):
            f = modes[t, c]
            if f >= 0:
                if t == 0 or modes[t - 1, c] != f:
                    facet[K] = f
                    K += 1
                interval[t, c] = K - 1
    return interval, facet[:K].copy()


@inlined
def ranges_of(scaled: ScaledTask, modes: IntArray, interval: IntArray, count: int) -> tuple[Array, Array]:
    """Range of rho (K,) that margins and walls leave at every step of an interval."""
    lo, hi = np.zeros(count), np.ones(count)
    for t in range(modes.shape[0]):
        for c in range(modes.shape[1]):
            k, f = interval[t, c], modes[t, c]
            if k >= 0:
                lo[k], hi[k] = max(lo[k], scaled.low[t, f]), min(hi[k], scaled.high[t, f])
    return lo, hi


@inlined
def free_variables(scaled: ScaledTask, modes: IntArray, first: int) -> tuple[IntArray, int]:
    """Two variables for each free position, from `first` on (-1: none), and the number of all variables."""
    free, n = np.full(modes.shape, -1), first
    for c in range(modes.shape[1]):
        if np.isnan(scaled.parking[0]) or (modes[:, c] >= 0).any():
            for t in range(modes.shape[0]):
                if modes[t, c] < 0:
                    free[t, c] = n
                    n += 2
    return free, n


@inlined
def positions_of(
    scaled: ScaledTask, modes: IntArray, interval: IntArray, free: IntArray, n: int
) -> tuple[Array, Array]:
    """Positions as offset (S, C, 2) + map (S, C, 2, n) z: on the facet (3-CT3), free, or parked."""
    S, C = modes.shape
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
    return offset, map


@inlined
def smoothing_form(scaled: ScaledTask, offset: Array, map: Array) -> tuple[Array, Array, float]:
    """Q, q, q0 of the smoothing cost |p_ddot|^2 = z'Qz/2 + q'z + q0 (Thesis 3.1.4)."""
    S, C, _, n = map.shape
    Q, q, q0 = np.zeros((n, n)), np.zeros(n), 0.0
    row, weight = np.zeros(n), 2 * scaled.acceleration_weight
    for c in range(C):
        for t in range(2, S):
            for d in range(2):
                constant = offset[t, c, d] - 2 * offset[t - 1, c, d] + offset[t - 2, c, d]
                for k in range(n):
                    row[k] = map[t, c, d, k] - 2 * map[t - 1, c, d, k] + map[t - 2, c, d, k]
                for i in range(n):
                    if row[i] != 0.0:
                        q[i] += weight * row[i] * constant
                        for j in range(n):
                            Q[i, j] += weight * row[i] * row[j]
                q0 += 0.5 * weight * constant * constant
    return Q, q, q0


@inlined
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
def pushes(sequence: Sequence, t: int) -> IntArray:
    """Intervals whose finger may push at t: those that go on (alternated sticking, 3-CT5), all at the last step."""
    S, C = sequence.modes.shape
    out, n = np.empty(C, np.int64), 0
    for c in range(C):
        k = sequence.interval[t, c]
        if k >= 0 and (t == S - 1 or sequence.interval[t + 1, c] == k):
            out[n] = k
            n += 1
    return out[:n]


@compiled
def fixed(sequence: Sequence, t: int, z: Array) -> Stance:
    """Who pushes at t, at the places in z."""
    on = pushes(sequence, t)
    return Stance(t, sequence.facet[on], z[on], z[on])


@compiled
def ranging(sequence: Sequence, t: int, lo: Array, hi: Array) -> Stance:
    """Who pushes at t, with every rho in its range."""
    on = pushes(sequence, t)
    return Stance(t, sequence.facet[on], lo[on], hi[on])


@compiled
def smoothing(sequence: Sequence, z: Array) -> float:
    """Smoothing cost at z."""
    return float(0.5 * z @ (sequence.Q @ z) + sequence.q @ z + sequence.q0)


@compiled
def accelerations(sequence: Sequence, z: Array) -> Array:
    """Backward second differences (max(S - 2, 0), C, 2) of the positions at z."""
    S, C, _, n = sequence.map.shape
    out = np.zeros((max(S - 2, 0), C, 2))
    for t in range(2, S):
        for c in range(C):
            for d in range(2):
                for u, weight in ((t, 1.0), (t - 1, -2.0), (t - 2, 1.0)):
                    out[t - 2, c, d] += weight * sequence.offset[u, c, d]
                    for k in range(n):
                        out[t - 2, c, d] += weight * sequence.map[u, c, d, k] * z[k]
    return out
