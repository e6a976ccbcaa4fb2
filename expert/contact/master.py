"""The master program over a box of contact positions, and what its multipliers prove, whatever the solver's tolerance."""

from typing import NamedTuple

import numpy as np

from expert.contact.box import Box, least_over_box
from expert.contact.scaled import ScaledTask
from expert.contact.sequence import Sequence, smoothing
from expert.contact.smoothing import ROUNDING
from expert.geometry.pose import Array
from expert.numeric.qp import BoolArray, inlined, solve_qp
from expert.world.values import IntArray


class Cut(NamedTuple):
    """Multipliers y of the balance of step t: a bound of its cost or, if `proof`, what rules out some rho."""

    t: int
    y: Array
    proof: bool


class Master(NamedTuple):
    """Minimise smoothing(z) + sum of theta_t subject to rows A (z, theta) >= b; room for more rows.

    step: which step's cut a row is, -1 for none; proof: whether it bounds no theta; y (., 3): its multipliers.
    filled (1,): rows in use.
    """

    H: Array
    g: Array
    A: Array
    b: Array
    step: IntArray
    proof: BoolArray
    y: Array
    filled: IntArray


@inlined
def solve_master(scaled: ScaledTask, master: Master) -> tuple[int, Array, Array]:
    """Status, minimiser (z, theta) and multipliers of the rows in use."""
    m = master.filled[0]
    return solve_qp(master.H, master.g, master.A[:m], master.b[:m], np.int64(0), scaled.iterations)


@inlined
def blend(master: Master, u: Array, proofs_alone: bool, steps: int) -> Array:
    """Multipliers (T, 3) of the balances that bound as much as all cuts with their weights u: D(y) is concave in y.

    The weights of a step's cuts must add up to one; proofs that rule out some rho come on top, or alone.
    """
    step, proof, each = master.step, master.proof, master.y
    y, total = np.zeros((steps, 3)), cut_weights(master, u, steps)
    for i in range(u.size):
        t = step[i]
        if t >= 0 and u[i] > 0.0 and (proof[i] or not proofs_alone):
            weight = u[i] if proof[i] else u[i] / total[t]
            for d in range(3):
                y[t, d] += weight * each[i, d]
    return y


@inlined
def cut_weights(master: Master, u: Array, steps: int) -> Array:
    """Sum (T,) of the multipliers of each step's cuts."""
    step, proof, total = master.step, master.proof, np.zeros(steps)
    for i in range(u.size):
        if step[i] >= 0 and not proof[i]:
            total[step[i]] += max(u[i], 0.0)
    return total


@inlined
def safe_bound(scaled: ScaledTask, box: Box, master: Master, z: Array, u: Array) -> float:
    """Weak duality at any multipliers: no plan in the box costs less, whatever the solver's tolerance."""
    sequence: Sequence = box.sequence
    A, b, step, proof = master.A, master.b, master.step, master.proof
    total = cut_weights(master, u, len(sequence.modes))
    if total.min() <= 0.0:
        return -np.inf
    slope = sequence.Q @ z + sequence.q
    bound = smoothing(sequence, z)
    for i in range(u.size):
        if u[i] > 0.0:
            weight = u[i] / total[step[i]] if step[i] >= 0 and not proof[i] else u[i]
            side = b[i]
            for j in range(z.size):
                side -= A[i, j] * z[j]
                slope[j] -= weight * A[i, j]
            bound += weight * side
    return bound + least_over_box(scaled, box.lo, box.hi, z, slope)


@inlined
def empty(scaled: ScaledTask, box: Box, master: Master, u: Array) -> bool:
    """Whether multipliers prove, rounding aside, that no z in the box satisfies the rows that bound no theta."""
    n = box.sequence.size
    row, side, size = np.zeros(n), 0.0, 0.0
    for i in range(u.size):
        if (master.step[i] < 0 or master.proof[i]) and u[i] > 0:
            row -= u[i] * master.A[i, :n]
            side += u[i] * master.b[i]
            size += u[i] * (abs(master.b[i]) + np.abs(master.A[i, :n]).sum())
    return side + least_over_box(scaled, box.lo, box.hi, np.zeros(n), row) > ROUNDING * size
