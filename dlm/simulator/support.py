"""Friction of the support plane (transverse scenes): every vertex, at velocity s, takes -F w, w = s / sqrt(|s|^2 + creep^2).

Velocity and friction are solved for together by Newton steps (Chan, Golub, Mulet).  Keeping w as an unknown of its own,
within the unit disc, lets Newton's method converge from afar.
"""

import numpy as np

from dlm.simulator.kernels import borrowing, inlined
from dlm.simulator.world import World, vertex_arm

CREEP = 1e-5
"""Support friction is Coulomb's above this speed and viscous below it [m/s]."""
ITERATIONS, TOLERANCE = 60, 1e-13


@borrowing
def directions(world: World, pose: np.ndarray, velocity: np.ndarray, w: np.ndarray) -> None:
    """Directions w, the first V of them (2,), that the support friction opposes."""
    facets = world.facets
    cs, sn = np.cos(pose[2]), np.sin(pose[2])
    for k in range(len(facets)):
        rx, ry = vertex_arm(facets[k].x, facets[k].y, cs, sn)
        sx, sy = velocity[0] - ry * velocity[2], velocity[1] + rx * velocity[2]
        speed = np.sqrt(sx * sx + sy * sy + CREEP**2)
        w[k, 0], w[k, 1] = sx / speed, sy / speed


@inlined
def linearise(
    world: World, pose: np.ndarray, guess: np.ndarray, w: np.ndarray, equation: tuple[np.ndarray, np.ndarray]
) -> None:
    """K v = b of the object with the friction, linearised at a velocity and its directions w; b holds its momentum.

    A vertex at arm r has velocity S v, S = [1 0 -r_y; 0 1 r_x], and adds S^T D S to K.
    """
    K, b = equation
    xx, xy, xt, yy, yt, tt = world.mass, 0.0, 0.0, world.mass, 0.0, world.inertia
    cs, sn = np.cos(pose[2]), np.sin(pose[2])
    for k in range(len(world.facets)):
        rx, ry = vertex_arm(world.facets[k].x, world.facets[k].y, cs, sn)
        sx, sy = guess[0] - ry * guess[2], guess[1] + rx * guess[2]
        speed = np.sqrt(sx * sx + sy * sy + CREEP**2)
        viscous = world.h * world.support / speed
        wx, wy = w[k, 0], w[k, 1]
        dx, dy = viscous * (1 - wx * sx / speed), viscous * (1 - wy * sy / speed)
        d = -0.5 * viscous * (wx * sy + wy * sx) / speed
        fx = (dx - viscous) * sx + d * sy
        fy = d * sx + (dy - viscous) * sy
        b[0] += fx
        b[1] += fy
        b[2] += -ry * fx + rx * fy
        xx, xy, yy = xx + dx, xy + d, yy + dy
        xt = xt - dx * ry + d * rx
        yt = yt - d * ry + dy * rx
        tt = tt + ry * dx * ry - ry * d * rx - rx * d * ry + rx * dy * rx
    K[0, 0], K[0, 1], K[0, 2] = xx, xy, xt
    K[1, 0], K[1, 1], K[1, 2] = xy, yy, yt
    K[2, 0], K[2, 1], K[2, 2] = xt, yt, tt


@inlined
def update_directions(
    world: World, pose: np.ndarray, before: np.ndarray, after: np.ndarray, w: np.ndarray
) -> float:
    """Newton step of the directions w, drawn back into the unit disc; returns the largest change of a vertex velocity."""
    cs, sn = np.cos(pose[2]), np.sin(pose[2])
    largest = 0.0
    for k in range(len(world.facets)):
        rx, ry = vertex_arm(world.facets[k].x, world.facets[k].y, cs, sn)
        sx, sy = before[0] - ry * before[2], before[1] + rx * before[2]
        dx = after[0] - ry * after[2] - sx
        dy = after[1] + rx * after[2] - sy
        speed = np.sqrt(sx * sx + sy * sy + CREEP**2)
        along = (sx * dx + sy * dy) / speed
        wx = (sx + dx - w[k, 0] * along) / speed
        wy = (sy + dy - w[k, 1] * along) / speed
        length = max(1.0, np.sqrt(wx * wx + wy * wy))
        w[k, 0], w[k, 1] = wx / length, wy / length
        largest = max(largest, abs(dx), abs(dy))
    return largest


@borrowing
def turning_slope(world: World, pose: np.ndarray, z: np.ndarray, v: np.ndarray) -> float:
    """Derivative of the friction's impulse along z, at velocity v, with respect to the object's angle."""
    cs, sn = np.cos(pose[2]), np.sin(pose[2])
    total = 0.0
    for k in range(len(world.facets)):
        rx, ry = vertex_arm(world.facets[k].x, world.facets[k].y, cs, sn)
        sx, sy = v[0] - v[2] * ry, v[1] + v[2] * rx
        speed = np.sqrt(sx * sx + sy * sy + CREEP**2)
        viscous = world.h * world.support / speed
        zx, zy = z[0] - z[2] * ry, z[1] + z[2] * rx
        along = (zx * sx + zy * sy) / (speed * speed)
        total += z[2] * viscous * (rx * sx + ry * sy)
        total += v[2] * viscous * (rx * (zx - along * sx) + ry * (zy - along * sy))
    return total


@borrowing
def invert(K: np.ndarray, out: np.ndarray) -> None:
    """Inverse of a symmetric positive definite (3, 3) matrix by cofactors."""
    for i in range(3):
        for j in range(3):
            a, b = (i + 1) % 3, (i + 2) % 3
            c, d = (j + 1) % 3, (j + 2) % 3
            out[j, i] = K[a, c] * K[b, d] - K[a, d] * K[b, c]
    determinant = K[0, 0] * out[0, 0] + K[0, 1] * out[1, 0] + K[0, 2] * out[2, 0]
    for i in range(3):
        for j in range(3):
            out[i, j] /= determinant
