"""From a plan at the knots to finger commands at every substep.

For fixed contact flags a command is an affine function of the plan, so the whole layer is one table per finger and
substep: two knots with weights for the position, two for the force, and an offset,

    command = x(s) + R(s) [ sum_a w_a rho_a + sum_a f_a lambda_a / k + offset ],   rho_a = R_a^T (p_a - x_a).

Poses (x, R) are the object's desired ones, at substep s and at the knots a: a finger in contact rides on the material
point of the surface.  With straight lines all of them are the identity.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from dlm.simulator.contact import VERTEX, View, nearest
from dlm.simulator.settings import Layers


class Commands(NamedTuple):
    """Tables of one scene, S + 1 substeps, C fingers: knots and weights of positions and of forces, each (S+1, C, 2).

    frame (S+1, 3) and knot_frame (T, 3) are poses; offset (S+1, C, 2) is in the frame of the substep.  It moves with the
    plan too: stand-off (T, C) along normal (T, C, 2) at the knots, with `slope` its derivative along the normal and
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
    slope: np.ndarray
    bend: np.ndarray


@njit(cache=True, error_model="numpy")
def desired_motion(path: np.ndarray, dt: float, size: float, layers: Layers) -> np.ndarray:
    """Poses (S + 1, 3) between the knots: constant-twist screws, run through without stops but for corners."""
    T = len(path)
    out = np.zeros(((T - 1) * layers.substeps + 1, 3))
    lengths = np.zeros(T - 1)
    for k in range(T - 1):
        d = path[k + 1] - path[k]
        lengths[k] = np.sqrt(d[0] ** 2 + d[1] ** 2 + (size * d[2]) ** 2)
    slope = _knot_speeds(path, lengths, size)
    out[0] = path[0]
    for k in range(T - 1):
        for i in range(1, layers.substeps + 1):
            u = i / layers.substeps
            s = u
            if layers.pchip and lengths[k] > 0:
                a, b = slope[k] / lengths[k], slope[k + 1] / lengths[k]
                s = u * (a + u * (3 - 2 * a - b + u * (a + b - 2)))
            screw(path[k], path[k + 1], s, out[k * layers.substeps + i])
    return out


@njit(cache=True, error_model="numpy")
def _knot_speeds(path: np.ndarray, lengths: np.ndarray, size: float) -> np.ndarray:
    """Path length per interval at the knots: harmonic means (monotone cubics), slowed down in corners, 0 at the ends."""
    T = len(path)
    speed = np.zeros(T)
    for k in range(1, T - 1):
        a, b = lengths[k - 1], lengths[k]
        if a > 0 and b > 0:
            before, after = path[k] - path[k - 1], path[k + 1] - path[k]
            inner = before[0] * after[0] + before[1] * after[1] + size * size * before[2] * after[2]
            speed[k] = max(inner / (a * b), 0.0) * 2 * a * b / (a + b)
    return speed


@njit(cache=True, error_model="numpy")
def screw(start: np.ndarray, stop: np.ndarray, s: float, out: np.ndarray) -> None:
    """Pose at share s of the constant-twist motion between two poses."""
    turn = stop[2] - start[2]
    dx, dy = stop[0] - start[0], stop[1] - start[1]
    whole = np.sin(turn / 2)
    if abs(whole) < 1e-9:
        scale, half = s, 0.0
    else:
        scale, half = np.sin(s * turn / 2) / whole, (s - 1) * turn / 2
    cs, sn = np.cos(half), np.sin(half)
    out[0] = start[0] + scale * (cs * dx - sn * dy)
    out[1] = start[1] + scale * (sn * dx + cs * dy)
    out[2] = start[2] + s * turn


@njit(cache=True, error_model="numpy")
def plan_commands(
    scene: View, path: np.ndarray, positions: np.ndarray, loaded: np.ndarray, layers: Layers
) -> Commands:
    """Tables for finger positions (T, C, 2) and flags loaded (T, C): the finger pushes from this knot on."""
    T, C = loaded.shape
    S = (T - 1) * layers.substeps
    size = np.sqrt(scene.inertia / scene.mass)
    motion = desired_motion(path, scene.dt, size, layers)
    knot, force_knot = np.zeros((S + 1, C, 2), np.int64), np.zeros((S + 1, C, 2), np.int64)
    weight, force = np.zeros((S + 1, C, 2)), np.zeros((S + 1, C, 2))
    offset = np.zeros((S + 1, C, 2))
    normals, slope, bend = np.zeros((T, C, 2)), np.zeros((T, C)), np.zeros((T, C))
    lift = np.zeros(T)
    for c in range(C):
        normal = normals[:, c]
        for t in range(T):
            lift[t], slope[t, c], bend[t, c] = _stand_off(
                scene, path[t], positions[t, c], loaded[t, c], layers, normal[t]
            )
        for i in range(S + 1):
            k = min(i // layers.substeps, T - 2)
            u = (i - k * layers.substeps) / layers.substeps
            a, b, w, bump_a, bump_b = _place(loaded[:, c], k, u, layers)
            knot[i, c, 0], knot[i, c, 1] = a, b
            weight[i, c, 0], weight[i, c, 1] = 1 - w, w
            if layers.compensation:
                fa, fb, share = _push(loaded, c, k, u, layers)
                force_knot[i, c, 0], force_knot[i, c, 1] = fa, fb
                force[i, c, 0], force[i, c, 1] = share
            away_a, away_b = (1 - w) * lift[a] + bump_a, w * lift[b] + bump_b
            roll_a = (1 - w) * _roll(loaded[:, c], path, motion[i], a, layers)
            roll_b = w * _roll(loaded[:, c], path, motion[i], b, layers)
            offset[i, c, 0] = away_a * normal[a, 0] + away_b * normal[b, 0]
            offset[i, c, 1] = away_a * normal[a, 1] + away_b * normal[b, 1]
            # No slip at the contact point: the centre falls back along the tangent, the normal turned by 90 degrees.
            offset[i, c, 0] += roll_a * normal[a, 1] + roll_b * normal[b, 1]
            offset[i, c, 1] -= roll_a * normal[a, 0] + roll_b * normal[b, 0]
    frames, knot_frames = (
        (motion, path.copy()) if layers.screw else (np.zeros_like(motion), np.zeros_like(path))
    )
    return Commands(knot, weight, force_knot, force, offset, frames, knot_frames, normals, slope, bend)


@njit(cache=True, error_model="numpy")
def _stand_off(
    scene: View, pose: np.ndarray, position: np.ndarray, loaded: bool, layers: Layers, normal: np.ndarray
) -> tuple[float, float, float]:
    """Distance that the finger's centre keeps from the planned point along the outward normal, its slope and bend.

    The normal comes back in the frame of the commands.
    """
    cs, sn = np.cos(pose[2]), np.sin(pose[2])
    dx, dy = position[0] - pose[0], position[1] - pose[1]
    bx, by = cs * dx + sn * dy, cs * dy - sn * dx
    kind, index, distance = nearest(scene.facets, bx, by)
    at_vertex = kind == VERTEX and abs(distance) > 1e-9
    if at_vertex:
        nx, ny = (bx - scene.facets[index].x) / distance, (by - scene.facets[index].y) / distance
    else:
        nx, ny = scene.facets[index].ox, scene.facets[index].oy
    if layers.screw:
        normal[0], normal[1] = nx, ny
    else:
        normal[0], normal[1] = cs * nx - sn * ny, sn * nx + cs * ny
    lift, slope = layers.radius, 0.0
    if not loaded and distance < layers.parking:
        lift, slope = layers.radius + layers.parking - distance, -1.0
    return lift, slope, (lift / distance if at_vertex else 0.0)


@njit(cache=True, error_model="numpy")
def _place(loaded: np.ndarray, k: int, u: float, layers: Layers) -> tuple[int, int, float, float, float]:
    """At share u of interval k, for flags (T,) of one finger: knots a and b, share of b, bumps along their normals [m]."""
    if loaded[k]:
        return (k, k + 1, u, 0.0, 0.0) if loaded[k + 1] else (k, k, 0.0, 0.0, 0.0)
    release, approach = k > 0 and loaded[k - 1], loaded[k + 1]
    a, b = k - 1 if release else k, k + 1
    leave = layers.release if release else 0.0
    arrive = 1 - layers.approach if approach else 1.0
    if u < leave:
        return a, a, 0.0, 0.0, 0.0
    if u >= arrive and approach:
        return b, b, 1.0, 0.0, 0.0
    x = (u - leave) / (arrive - leave)
    bump = layers.lift_off * np.sin(np.pi * x)
    return a, b, x * x * (3 - 2 * x), bump if release else 0.0, bump if approach else 0.0


@njit(cache=True, error_model="numpy")
def _push(
    loaded: np.ndarray, c: int, k: int, u: float, layers: Layers
) -> tuple[int, int, tuple[float, float]]:
    """At share u of interval k: knots a and b and the shares of their forces that finger c exerts.

    Forces balance at the knots, for the fingers loaded there.  Where one comes or goes, all change over at once.
    """
    if not loaded[k, c]:
        if k > 0 and loaded[k - 1, c] and u < layers.release:
            return k - 1, k - 1, (1 - u / layers.release, 0.0)
        if loaded[k + 1, c]:
            return k + 1, k + 1, (_late(u, layers.approach), 0.0)
        return k, k, (0.0, 0.0)
    if not loaded[k + 1, c]:
        return k, k, (1.0, 0.0)
    begin = 0.0
    if layers.handover and k > 0 and loaded[k - 1, c] and _leaves(loaded, k - 1):
        begin = layers.release
        if u < begin:
            return k - 1, k, (1 - u / begin, u / begin)
    share = (u - begin) / (1 - begin)
    if layers.handover and _leaves(loaded, k):
        share = 0.0
    elif layers.handover and _arrives(loaded, k):
        share = _late(u, layers.approach)
    return k, k + 1, (1 - share, share)


@njit(cache=True, error_model="numpy")
def _late(u: float, span: float) -> float:
    """Ramp from 0 to 1 over the last `span` of an interval."""
    if u >= 1:
        return 1.0
    return max(u - (1 - span), 0.0) / span if span > 0 else 0.0


@njit(cache=True, error_model="numpy")
def _leaves(loaded: np.ndarray, k: int) -> bool:
    """Whether some finger pushes for the last time in interval k."""
    return _changes(loaded[k], loaded[k + 1])


@njit(cache=True, error_model="numpy")
def _arrives(loaded: np.ndarray, k: int) -> bool:
    """Whether some finger pushes for the first time at the end of interval k."""
    return _changes(loaded[k + 1], loaded[k])


@njit(cache=True, error_model="numpy")
def _changes(now: np.ndarray, then: np.ndarray) -> bool:
    """Whether some flag is set now and not then."""
    for c in range(len(now)):  # noqa: SIM110  (numba knows no generators here)
        if now[c] and not then[c]:
            return True
    return False


@njit(cache=True, error_model="numpy")
def _roll(loaded: np.ndarray, path: np.ndarray, pose: np.ndarray, t: int, layers: Layers) -> float:
    """Distance that a round finger rolls along the facet since its contact began."""
    if not layers.rolling or not loaded[t]:
        return 0.0
    start = t
    while start > 0 and loaded[start - 1]:
        start -= 1
    return layers.radius * (pose[2] - path[start, 2])


@njit(cache=True, error_model="numpy")
def command(
    table: Commands,
    positions: np.ndarray,
    forces: np.ndarray,
    stiffness: float,
    out: np.ndarray,
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


@njit(cache=True, error_model="numpy")
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


@njit(cache=True, error_model="numpy")
def _add_to_world(frame: np.ndarray, x: float, y: float, out: np.ndarray) -> None:
    cs, sn = np.cos(frame[2]), np.sin(frame[2])
    out[0] += cs * x - sn * y
    out[1] += sn * x + cs * y
