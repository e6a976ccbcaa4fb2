"""Finger commands as an affine function of the plan.

For fixed contact flags the whole execution layer is one table per finger and substep: two knots with weights for the
position, two for the force, and an offset,

    command = x(s) + R(s) [ sum_a w_a rho_a + sum_a f_a lambda_a / k + offset ],   rho_a = R_a^T (p_a - x_a).

Poses (x, R) are the object's desired ones, at substep s and at the knots a: a finger in contact rides on the material
point of the surface.  With straight lines all of them are the identity.
"""

from typing import NamedTuple

import numpy as np

from dlm.simulator.kernels import borrowing, compiled


class Commands(NamedTuple):
    """Tables of one scene, S + 1 substeps, C fingers: knots and weights of positions and of forces, each (S+1, C, 2).

    frame (S+1, 3) and knot_frame (T, 3) are poses; offset (S+1, C, 2) is in the frame of the substep.  It moves with the
    plan too: stand-off `lift` (T, C) along normal (T, C, 2) at the knots, with `slope` its derivative along the normal and
    `bend` the stand-off over the distance to a vertex, about which the normal turns.
    """

    knot: np.ndarray
    weight: np.ndarray
    force_knot: np.ndarray
    force_weight: np.ndarray
    offset: np.ndarray
    frame: np.ndarray
    knot_frame: np.ndarray
    normal: np.ndarray
    lift: np.ndarray
    slope: np.ndarray
    bend: np.ndarray


@compiled
def commands_for(samples: int, knots: int, fingers: int) -> Commands:
    """A table of zeros."""
    shape, at_knots = (samples, fingers, 2), (knots, fingers)
    return Commands(
        np.zeros(shape, np.int64),
        np.zeros(shape),
        np.zeros(shape, np.int64),
        np.zeros(shape),
        np.zeros(shape),
        np.zeros((samples, 3)),
        np.zeros((knots, 3)),
        np.zeros((knots, fingers, 2)),
        np.zeros(at_knots),
        np.zeros(at_knots),
        np.zeros(at_knots),
    )


@compiled
def command(
    table: Commands, positions: np.ndarray, forces: np.ndarray, stiffness: float, out: np.ndarray
) -> None:
    """Commands (first samples of the table, as many as `out` has, C, 2) from positions and forces (T, C, 2).

    Infinite stiffness leaves the forces out: where the fingers themselves are planned to be.
    """
    T, C = positions.shape[:2]
    local = np.empty((2, T, C, 2))
    for t in range(T):
        at = table.knot_frame[t]
        cs, sn = np.cos(at[2]), np.sin(at[2])
        for c in range(C):
            for k, x, y in (
                (0, positions[t, c, 0] - at[0], positions[t, c, 1] - at[1]),
                (1, forces[t, c, 0] / stiffness, forces[t, c, 1] / stiffness),
            ):
                local[k, t, c, 0], local[k, t, c, 1] = cs * x + sn * y, cs * y - sn * x
    for i in range(len(out)):
        frame = table.frame[i]
        cs, sn = np.cos(frame[2]), np.sin(frame[2])
        for c in range(C):
            x, y = table.offset[i, c, 0], table.offset[i, c, 1]
            for side in range(2):
                t, w, f = table.knot[i, c, side], table.weight[i, c, side], table.force_weight[i, c, side]
                j = table.force_knot[i, c, side]
                x += w * local[0, t, c, 0] + f * local[1, j, c, 0]
                y += w * local[0, t, c, 1] + f * local[1, j, c, 1]
            out[i, c, 0] = frame[0] + cs * x - sn * y
            out[i, c, 1] = frame[1] + sn * x + cs * y


@compiled
def pull_back(
    table: Commands, adjoint: np.ndarray, stiffness: float, positions: np.ndarray, forces: np.ndarray
) -> None:
    """Transpose of the derivative of `command`: add to the gradients with respect to positions and forces."""
    T, C = table.slope.shape
    knots = np.zeros((T, C, 2))
    for i in range(len(adjoint)):
        frame = table.frame[i]
        cs, sn = np.cos(frame[2]), np.sin(frame[2])
        for c in range(C):
            gx, gy = adjoint[i, c, 0], adjoint[i, c, 1]
            bx, by = cs * gx + sn * gy, cs * gy - sn * gx
            for side in range(2):
                t, w, f = table.knot[i, c, side], table.weight[i, c, side], table.force_weight[i, c, side]
                knots[t, c, 0] += w * bx
                knots[t, c, 1] += w * by
                j = table.force_knot[i, c, side]
                _add_to_world(table.knot_frame[j], f * bx / stiffness, f * by / stiffness, forces[j, c])
    for t in range(T):
        for c in range(C):
            n, gx, gy = table.normal[t, c], knots[t, c, 0], knots[t, c, 1]
            along = n[0] * gx + n[1] * gy
            grow, turn = (table.slope[t, c] - table.bend[t, c]) * along, 1 + table.bend[t, c]
            _add_to_world(
                table.knot_frame[t], turn * gx + grow * n[0], turn * gy + grow * n[1], positions[t, c]
            )


@borrowing
def _add_to_world(frame: np.ndarray, x: float, y: float, out: np.ndarray) -> None:
    cs, sn = np.cos(frame[2]), np.sin(frame[2])
    out[0] += cs * x - sn * y
    out[1] += sn * x + cs * y
