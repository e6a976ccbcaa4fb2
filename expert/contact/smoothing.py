"""Least smoothing cost of one finger by itself, free positions outside the object: a small tree over free regions."""

import numpy as np

from expert.contact.box import Box, least_over_box, standing_rows, worst_intrusion
from expert.contact.scaled import ScaledTask
from expert.contact.sequence import accelerations, sequence_of, smoothing
from expert.geometry.pose import Array
from expert.numeric.qp import INFEASIBLE, SOLVED, compiled, solve_qp
from expert.world.values import IntArray

FLAT = 1e-8
"""Curvature, relative to the smoothing weight, that holds directions without any cost near a reference."""
PROXIMAL, TIGHT = 2, 1e-7
"""Programs solved in turn until the bound is as good as the path: the ridge, which pulls at the reference, then pulls at nothing."""
ROUNDING = 1e-12
"""Relative size of the terms of a proof that rounding may have made up."""


@compiled
def least_smoothing(scaled: ScaledTask, modes: IntArray, assigned: IntArray) -> tuple[float, int, Array]:
    """Lower bound of the smoothing cost of one finger's modes (S, 1) with its regions (inf: no room), the step to branch on,
    where the finger is deepest inside the object (-1: nowhere), and the accelerations (S - 2, 2) that prove the bound."""
    s = sequence_of(scaled, modes)
    none = np.zeros((max(len(modes) - 2, 0), 2))
    if (s.lo > s.hi).any():
        return np.inf, -1, none
    if s.size == 0:
        return float(s.q0), -1, none  # parked
    A, b = standing_rows(scaled, Box(s, s.lo, s.hi, assigned), s.size)
    ridge = FLAT * (1 + scaled.acceleration_weight)
    H, reference, least, proved = s.Q + ridge * np.eye(s.size), s.reference, 0.0, none
    z = reference
    for _ in range(PROXIMAL):
        status, z, u = solve_qp(H, s.q - ridge * reference, A, b, np.int64(0), scaled.iterations)
        u = np.maximum(u, 0.0)
        if status == INFEASIBLE:
            bound = u @ b + least_over_box(scaled, s.lo, s.hi, np.zeros(s.size), -(u @ A))
            certain = ROUNDING * np.abs(u).max() * (1 + np.abs(b).max()) * b.size
            return np.inf if bound > certain else 0.0, -1, none
        if status != SOLVED:
            return 0.0, -1, none
        slope = s.Q @ z + s.q - u @ A
        bound = smoothing(s, z) + u @ (b - A @ z) + least_over_box(scaled, s.lo, s.hi, z, slope)
        reference = z
        if bound > least:
            least, proved = float(bound), accelerations(s, z)[:, 0].copy()
        if smoothing(s, z) - least <= TIGHT * (1 + least):
            break
    t, _, _ = worst_intrusion(scaled, Box(s, s.lo, s.hi, assigned), z)
    return least, t, proved
