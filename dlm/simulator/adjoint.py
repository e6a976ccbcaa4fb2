"""Derivatives of rollouts: the adjoint of the time step by the implicit function theorem.

With the active set known, the impulses solve linear equations B P + c = 0; their derivative needs one solve with B^T.
What remains is the chain rule through the contact geometry, kept here in the order of the forward computation reversed.
"""

import numpy as np
from numba import njit

from dlm.simulator.contact import FACET, WALL, View, view
from dlm.simulator.execution import command, plan_commands, pull_back
from dlm.simulator.lcp import OPEN, SLIP_PLUS, STICK, reduced_system, solve_linear
from dlm.simulator.rollout import acceptable, advance, motion_for, start_motion
from dlm.simulator.scene import SceneArrays
from dlm.simulator.settings import Layers, Physics
from dlm.simulator.step import (
    CORRECTION,
    FASTEST_CORRECTION,
    SHALLOW,
    SUPPORT_CREEP,
    Work,
    assemble_problem,
    bias,
    contact_scale,
    finger_mobility,
    softness,
    solve_step,
    support_directions,
    support_mobility,
    vertex_arm,
    work_for,
)

TOUCHING = 1e-12
"""Plans start with fingers that touch: there smoothed contacts have a kink, and the mean of both slopes is taken [m]."""


@njit(cache=True, error_model="numpy")
def softness_slope(gap: float, physics: Physics) -> float:
    """Derivative of `softness` with respect to the gap: (1 - a) / a = (exp(kappa gap) - 1) / 2 where the gap is open."""
    if np.isinf(physics.kappa) or gap < -TOUCHING or physics.kappa * gap > 500:
        return 0.0
    slope = 0.5 * physics.kappa * np.exp(physics.kappa * gap)
    return slope if gap > TOUCHING else slope / 2


@njit(cache=True, error_model="numpy")
def bias_slope(gap: float, h: float, physics: Physics) -> float:
    """Derivative of `bias` with respect to the gap."""
    if gap < -SHALLOW:
        return CORRECTION / h if bias(gap, h, physics.kappa) > -FASTEST_CORRECTION else 0.0
    if np.isinf(physics.kappa) or gap < -TOUCHING:
        return 1 / h
    return 0.0 if gap > TOUCHING else 0.5 / h


@njit(cache=True, error_model="numpy")
def row_multipliers(n: int, work: Work, impulse_adjoint: np.ndarray, w: np.ndarray) -> None:
    """Solve B^T w = adjoint of the impulses, for the equations of the active set; w is 0 on all other rows."""
    contacts, rows = work.contacts, work.rows
    size = reduced_system(n, contacts, rows, work.A, work.B, True)
    row = 0
    for i in range(n):
        state, mu = contacts[i].state, contacts[i].friction
        value, tangential = impulse_adjoint[2 * i], impulse_adjoint[2 * i + 1]
        if state == OPEN:
            continue
        if state == STICK:
            rows[row + 1].rhs = tangential
        else:
            value += mu * tangential if state == SLIP_PLUS else -mu * tangential
        rows[row].rhs = value
        row += 2 if state == STICK else 1
    regular = solve_linear(work.B, rows, size)
    w[:] = 0
    row = 0
    for i in range(n):
        if regular and contacts[i].state != OPEN:
            w[2 * i] = rows[row].rhs
            row += 1
            if contacts[i].state == STICK:
                w[2 * i + 1] = rows[row].rhs
                row += 1


@njit(cache=True, error_model="numpy")
def adjoint_step(
    scene: View,
    physics: Physics,
    q: np.ndarray,
    v: np.ndarray,
    p: np.ndarray,
    u: np.ndarray,
    q_bar: np.ndarray,
    v_bar: np.ndarray,
    p_bar: np.ndarray,
    u_bar: np.ndarray,
    work: Work,
) -> None:
    """Turn the adjoints of the state after the step into those before it, in place; u_bar receives the command's."""
    h = scene.dt / physics.substeps
    n, _ = solve_step(scene, physics, q, v, p, u, work)
    if scene.support > 0:
        guess = work.velocity.copy()
        friction = support_directions(scene.facets, q, guess)
        support_mobility(scene, physics, q, v, guess, friction, work)
        assemble_problem(n, scene, physics, work)
    give = finger_mobility(scene.stiffness, physics.damping, h)
    end, ends = v_bar + h * q_bar, h * p_bar
    weighted = work.mobility @ end
    impulse_adjoint, w = np.zeros(2 * n), np.zeros(2 * n)
    for r in range(2 * n):
        row, f = work.rows[r], work.contacts[r // 2].finger
        impulse_adjoint[r] = row.x * weighted[0] + row.y * weighted[1] + row.turn * weighted[2]
        if f >= 0:
            impulse_adjoint[r] -= give * (row.x * ends[f, 0] + row.y * ends[f, 1])
    row_multipliers(n, work, impulse_adjoint, w)
    for r in range(2 * n):
        row, f = work.rows[r], work.contacts[r // 2].finger
        end[0] -= w[r] * row.x
        end[1] -= w[r] * row.y
        end[2] -= w[r] * row.turn
        if f >= 0:
            ends[f, 0] += w[r] * row.x
            ends[f, 1] += w[r] * row.y
    z = work.mobility @ end
    for i in range(n):
        if work.rows[2 * i].P != 0 or w[2 * i] != 0:
            _adjoint_contact(i, scene, physics, q, p, z, ends, w, q_bar, p_bar, work)
    if scene.support > 0:
        q_bar[2] += _adjoint_support(scene, physics, q, z, work.velocity)
    v_bar[0], v_bar[1], v_bar[2] = scene.mass * z[0], scene.mass * z[1], scene.inertia * z[2]
    follow = scene.stiffness / (scene.stiffness * h + physics.damping)
    for c in range(len(p)):
        for d in range(2):
            u_bar[c, d] = follow * ends[c, d]
            p_bar[c, d] -= follow * ends[c, d]


@njit(cache=True, error_model="numpy")
def _adjoint_contact(
    i: int,
    scene: View,
    physics: Physics,
    q: np.ndarray,
    p: np.ndarray,
    z: np.ndarray,
    ends: np.ndarray,
    w: np.ndarray,
    q_bar: np.ndarray,
    p_bar: np.ndarray,
    work: Work,
) -> None:
    """Adjoint of contact i's rows, bias and compliance, then of its geometry."""
    contact, h = work.contacts[i], scene.dt / physics.substeps
    f, gap = contact.finger, contact.gap
    give = finger_mobility(scene.stiffness, physics.damping, h) if f >= 0 else 0.0
    soft, slope = softness(gap, physics.kappa, physics.regularization), softness_slope(gap, physics)
    ax, ay = contact.x - q[0], contact.y - q[1]
    nx_bar, ny_bar, ax_bar, ay_bar = 0.0, 0.0, 0.0, 0.0
    gap_bar = -w[2 * i] * bias_slope(gap, h, physics)
    for part in range(2):
        row, m = work.rows[2 * i + part], w[2 * i + part]
        turn = row.P * z[2] - m * work.velocity[2] - 2 * m * row.P * soft * row.turn / scene.inertia
        gap_bar -= m * row.P * slope * contact_scale(scene.mass, scene.inertia, row.turn, give)
        ex = row.P * z[0] - m * work.velocity[0] - turn * ay
        ey = row.P * z[1] - m * work.velocity[1] + turn * ax
        if f >= 0:
            ex += m * work.finger_velocity[f, 0] - give * row.P * ends[f, 0]
            ey += m * work.finger_velocity[f, 1] - give * row.P * ends[f, 1]
        ax_bar += turn * row.y
        ay_bar -= turn * row.x
        # The tangent is the normal turned by 90 degrees.
        nx_bar += ex if part == 0 else ey
        ny_bar += ey if part == 0 else -ex
    q_bar[0] -= ax_bar
    q_bar[1] -= ay_bar
    _adjoint_geometry(
        contact,
        scene.facets[contact.feature],
        physics.radius,
        q,
        p,
        nx_bar,
        ny_bar,
        ax_bar,
        ay_bar,
        gap_bar,
        q_bar,
        p_bar,
    )


@njit(cache=True, error_model="numpy")
def _adjoint_geometry(
    contact: np.record,
    facet: np.record,
    radius: float,
    q: np.ndarray,
    p: np.ndarray,
    nx_bar: float,
    ny_bar: float,
    cx_bar: float,
    cy_bar: float,
    gap_bar: float,
    q_bar: np.ndarray,
    p_bar: np.ndarray,
) -> None:
    """Adjoint of normal, contact point and gap with respect to the object's pose and the finger."""
    rx, ry = vertex_arm(facet.x, facet.y, np.cos(q[2]), np.sin(q[2]))
    if contact.kind == WALL:
        _to_pose(cx_bar + gap_bar * contact.nx, cy_bar + gap_bar * contact.ny, rx, ry, q_bar)
        return
    f, ox, oy = contact.finger, -contact.nx, -contact.ny
    sx, sy = p[f, 0] - q[0] - rx, p[f, 1] - q[1] - ry
    if contact.kind == FACET:
        distance = contact.gap + radius
        distance_bar = gap_bar - cx_bar * ox - cy_bar * oy
        mx = distance_bar * sx - nx_bar - distance * cx_bar
        my = distance_bar * sy - ny_bar - distance * cy_bar
        p_bar[f, 0] += cx_bar + distance_bar * ox
        p_bar[f, 1] += cy_bar + distance_bar * oy
        _to_pose(-distance_bar * ox, -distance_bar * oy, rx, ry, q_bar)
        q_bar[2] += my * ox - mx * oy
        return
    sign, reach = 1 - 2 * facet.reflex, np.sqrt(sx * sx + sy * sy)
    ex, ey = sx / reach, sy / reach
    along = -nx_bar * ex - ny_bar * ey
    gx = sign * ((-nx_bar - along * ex) / reach + gap_bar * ex)
    gy = sign * ((-ny_bar - along * ey) / reach + gap_bar * ey)
    p_bar[f, 0] += gx
    p_bar[f, 1] += gy
    _to_pose(cx_bar - gx, cy_bar - gy, rx, ry, q_bar)


@njit(cache=True, error_model="numpy")
def _to_pose(gx: float, gy: float, rx: float, ry: float, q_bar: np.ndarray) -> None:
    """Adjoint of a body point at arm (rx, ry)."""
    q_bar[0] += gx
    q_bar[1] += gy
    q_bar[2] += gy * rx - gx * ry


@njit(cache=True, error_model="numpy")
def _adjoint_support(scene: View, physics: Physics, q: np.ndarray, z: np.ndarray, v: np.ndarray) -> float:
    """Derivative of the support friction's impulse along z with respect to the object's angle."""
    h = scene.dt / physics.substeps
    cs, sn = np.cos(q[2]), np.sin(q[2])
    total = 0.0
    for k in range(len(scene.facets)):
        rx, ry = vertex_arm(scene.facets[k].x, scene.facets[k].y, cs, sn)
        sx, sy = v[0] - v[2] * ry, v[1] + v[2] * rx
        speed = np.sqrt(sx * sx + sy * sy + SUPPORT_CREEP**2)
        viscous = h * scene.support / speed
        zx, zy = z[0] - z[2] * ry, z[1] + z[2] * rx
        along = (zx * sx + zy * sy) / (speed * speed)
        total += z[2] * viscous * (rx * sx + ry * sy)
        total += v[2] * viscous * (rx * (zx - along * sx) + ry * (zy - along * sy))
    return total


@njit(cache=True, error_model="numpy", nogil=True)
def implicit_batch(
    scenes: SceneArrays,
    physics: Physics,
    layers: Layers,
    positions: np.ndarray,
    forces: np.ndarray,
    loaded: np.ndarray,
    start: np.ndarray,
    adjoint: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Gradients with respect to positions and forces (B, T, C, 2), given that of the knot poses (B, T, 3)."""
    B, T, C = loaded.shape
    d_positions, d_forces = np.zeros_like(positions), np.zeros_like(forces)
    work = work_for(C, scenes.walls.shape[1])
    S = (T - 1) * layers.substeps
    motion, commands, u_bar = motion_for(S + 1, C), np.zeros((S + 1, C, 2)), np.zeros((S + 1, C, 2))
    for b in range(B):
        if not acceptable(positions[b], forces[b]):
            continue
        scene = view(scenes, b)
        table = plan_commands(scene, scenes.path[b], positions[b], loaded[b], layers)
        command(table, positions[b], forces[b], scene.stiffness, commands)
        motion.poses[0] = start[b]
        start_motion(table, positions[b], forces[b], motion)
        if not advance(scene, physics, commands, 0, motion, work):
            continue
        q_bar, v_bar, p_bar = np.zeros(3), np.zeros(3), np.zeros((C, 2))
        u_bar[:] = 0
        for i in range(S - 1, -1, -1):
            if (i + 1) % layers.substeps == 0:
                q_bar += adjoint[b, (i + 1) // layers.substeps]
            q, v, p = motion.poses[i], motion.velocities[i], motion.fingers[i]
            adjoint_step(scene, physics, q, v, p, commands[i + 1], q_bar, v_bar, p_bar, u_bar[i + 1], work)
        pull_back(table, u_bar, scene.stiffness, d_positions[b], d_forces[b])
        u_bar[0] = p_bar
        pull_back(table, u_bar[:1], np.inf, d_positions[b], d_forces[b])
        if not (np.isfinite(d_positions[b]).all() and np.isfinite(d_forces[b]).all()):
            d_positions[b], d_forces[b] = 0, 0
    return d_positions, d_forces
