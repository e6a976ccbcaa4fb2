"""The convex program at fixed modes with the torque expanded to first order at a point, (p0 - q) x lambda + (p - p0) x lambda0."""

from typing import NamedTuple

import numpy as np

from expert.contact.box import Box, nearest_region, standing_rows
from expert.contact.scaled import ScaledTask
from expert.contact.sequence import Sequence, fixed, pushes
from expert.contact.steps import RIDGE, rays_per_end, step_program
from expert.geometry.pose import Array
from expert.numeric.qp import compiled, inlined
from expert.world.values import IntArray

PROXIMAL = 1e-6
"""Curvature, relative to the smoothing weight, towards the current point: settles flat directions, moves no fixed point."""


class Program(NamedTuple):
    """The convex program at a point, over z and all ray weights: min v'Hv/2 + g'v, A v = b (first rows), A v >= b.

    first (T + 1,): where each step's ray weights start; torque (T,): row of its torque balance, -1 for none.
    """

    H: Array
    g: Array
    A: Array
    b: Array
    equalities: int
    first: IntArray
    torque: IntArray


@compiled
def first_order(scaled: ScaledTask, sequence: Sequence, z: Array, weights: Array) -> Program:
    """The program at z and ray weights (T, N); both are held by a proximal term, free fingers by the regions they are in."""
    T, n = len(sequence.modes), z.size
    regions = settle_regions(scaled, sequence, z)
    standing, side = standing_rows(scaled, Box(sequence, sequence.lo, sequence.hi, regions), n)
    program = empty_program(scaled, sequence, z, side.size)
    proximal = PROXIMAL * (1 + scaled.acceleration_weight)
    program.H[:n, :n] = sequence.Q + proximal * np.eye(n)
    program.g[:n] = sequence.q - proximal * z
    first, row = program.equalities, program.equalities + side.size
    program.A[first:row, :n], program.b[first:row] = standing, side
    for t in range(T):
        if program.torque[t] >= 0:
            row = add_step(scaled, program, sequence, z, weights[t], t, row)
    return program


@inlined
def empty_program(scaled: ScaledTask, sequence: Sequence, z: Array, standing: int) -> Program:
    """Room for all steps and so many standing rows; where each step's weights and its torque balance will be."""
    T = len(sequence.modes)
    first, torque = np.full(T + 1, z.size), np.full(T, -1)
    balances, rows = 0, standing
    for t in range(T):
        step = step_program(scaled, fixed(sequence, t, z))
        first[t + 1] = first[t] + step.g.size
        if step.g.size > 0:
            torque[t] = balances + 2
            balances, rows = balances + 3, rows + step.b.size
    width = first[T]
    H, A = np.zeros((width, width)), np.zeros((rows, width))
    return Program(H, np.zeros(width), A, np.zeros(rows), balances, first, torque)


@inlined
def add_step(
    scaled: ScaledTask, program: Program, sequence: Sequence, z: Array, weights: Array, t: int, row: int
) -> int:
    """Balance and inequalities of step t, the latter from `row` on; returns the next row."""
    each, span, on = rays_per_end(scaled), slice(program.first[t], program.first[t + 1]), pushes(sequence, t)
    step = step_program(scaled, fixed(sequence, t, z))
    top, end = program.torque[t] - 2, row + step.b.size - 3
    program.H[span, span] = step.H
    program.g[span] = step.g - RIDGE * weights[: step.g.size]
    program.A[top : top + 3, span], program.b[top : top + 3] = step.A[:3], step.b[:3]
    for i in range(on.size):
        arm = scaled.length[sequence.facet[on[i]]] * weights[each * i : each * (i + 1)].sum()
        program.A[top + 2, on[i]] += arm
        program.b[top + 2] += arm * z[on[i]]
    program.A[row:end, span], program.b[row:end] = step.A[3:], step.b[3:]
    return end


@inlined
def settle_regions(scaled: ScaledTask, sequence: Sequence, z: Array) -> IntArray:
    """Region with most room around each free finger, (T, C); -1 elsewhere."""
    assigned = np.full(sequence.modes.shape, -1)
    for t in range(assigned.shape[0]):
        for c in range(assigned.shape[1]):
            v = sequence.free[t, c]
            if v >= 0:
                assigned[t, c], _ = nearest_region(scaled, t, z[v], z[v + 1])
    return assigned


def curvature(scaled: ScaledTask, sequence: Sequence, program: Program, u: Array) -> Array:
    """Second derivative of the Lagrangian's torque terms, -u_tau l d(rho) d(lambda_n)."""
    bent, each = np.zeros_like(program.H), rays_per_end(scaled)
    for t, row in enumerate(program.torque):
        for i, k in enumerate(pushes(sequence, t)):
            rays = program.first[t] + np.arange(each * i, each * (i + 1))
            bent[k, rays] -= u[row] * scaled.length[sequence.facet[k]]
    return bent + bent.T
