"""Friction of the support plane (transverse scenes): every vertex, at velocity s, takes -F w, w = s / sqrt(|s|^2 + creep^2).

Velocity and friction are solved for together by Newton steps (Chan, Golub, Mulet).  Keeping w as an unknown of its own,
within the unit disc, lets Newton's method converge from afar.
"""

import numpy as np
from numba import njit

from dlm.simulator.world import World, vertex_arm

CREEP = 1e-5
"""Support friction is Coulomb's above this speed and viscous below it [m/s]."""
ITERATIONS, TOLERANCE = 60, 1e-13


@njit(cache=True, error_model="numpy")
def directions(world: World, pose: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """Directions w (V, 2) that the support friction opposes."""
    facets = world.facets
    w = np.zeros((len(facets), 2))
    cs, sn = np.cos(pose[2]), np.sin(pose[2])
    for k in range(len(w)):
        rx, ry = vertex_arm(facets[k].x, facets[k].y, cs, sn)
        sx, sy = velocity[0] - ry * velocity[2], velocity[1] + rx * velocity[2]
        speed = np.sqrt(sx * sx + sy * sy + CREEP**2)
        w[k, 0], w[k, 1] = sx / speed, sy / speed
    return w


@njit(cache=True, error_model="numpy", inline="always")
def linearise(
    world: World, pose: np.ndarray, guess: np.ndarray, w: np.ndarray, K: np.ndarray, b: np.ndarray
) -> None:
    """Add the friction, linearised at a velocity and its directions w, to K v = b."""
    S, D = np.zeros((2, 3)), np.zeros((2, 2))
    cs, sn = np.cos(pose[2]), np.sin(pose[2])
    S[0, 0] = S[1, 1] = 1
    for k in range(len(world.facets)):
        rx, ry = vertex_arm(world.facets[k].x, world.facets[k].y, cs, sn)
        S[0, 2], S[1, 2] = -ry, rx
        sx, sy = guess[0] - ry * guess[2], guess[1] + rx * guess[2]
        speed = np.sqrt(sx * sx + sy * sy + CREEP**2)
        viscous = world.h * world.support / speed
        wx, wy = w[k, 0], w[k, 1]
        D[0, 0], D[1, 1] = viscous * (1 - wx * sx / speed), viscous * (1 - wy * sy / speed)
        D[0, 1] = D[1, 0] = -0.5 * viscous * (wx * sy + wy * sx) / speed
        fx = (D[0, 0] - viscous) * sx + D[0, 1] * sy
        fy = D[1, 0] * sx + (D[1, 1] - viscous) * sy
        for i in range(3):
            b[i] += S[0, i] * fx + S[1, i] * fy
            for j in range(3):
                for d in range(2):
                    for e in range(2):
                        K[i, j] += S[d, i] * D[d, e] * S[e, j]


@njit(cache=True, error_model="numpy", inline="always")
def update_directions(
    world: World, pose: np.ndarray, before: np.ndarray, after: np.ndarray, w: np.ndarray
) -> float:
    """Newton step of the directions w, drawn back into the unit disc; returns the largest change of a vertex velocity."""
    cs, sn = np.cos(pose[2]), np.sin(pose[2])
    largest = 0.0
    for k in range(len(w)):
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


@njit(cache=True, error_model="numpy")
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


@njit(cache=True, error_model="numpy")
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
