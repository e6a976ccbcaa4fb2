"""Derivatives of rollouts: the adjoint of the time step by the implicit function theorem, and central differences.

With the active set known, the impulses solve linear equations B P + c = 0; their derivative needs one solve with B^T.
What remains is the chain rule through the contact geometry, kept here in the order of the forward computation reversed.
"""

import numpy as np
from numba import njit

from dlm.simulator.contact import FACET, WALL, View, view
from dlm.simulator.execution import Commands, command, plan_commands, pull_back
from dlm.simulator.lcp import OPEN, SLIP_PLUS, STICK, reduced_system, solve_linear
from dlm.simulator.rollout import Motion, acceptable, advance, motion_for, start_motion
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
    finger_mobility,
    scale,
    softness,
    solve_step,
    support_directions,
    support_mobility,
    vertex_arm,
    work_for,
)


TOUCHING = 1e-12
"""Plans start with fingers that touch: there smoothed contacts have a kink, and the mean of both slopes is taken [m]."""


@njit(cache=True)
def softness_slope(gap: float, physics: Physics) -> float:
    """Derivative of `softness` with respect to the gap: (1 - a) / a = (exp(kappa gap) - 1) / 2 where the gap is open."""
    if np.isinf(physics.kappa) or gap < -TOUCHING or physics.kappa * gap > 500:
        return 0.0
    slope = 0.5 * physics.kappa * np.exp(physics.kappa * gap)
    return slope if gap > TOUCHING else slope / 2


@njit(cache=True)
def bias_slope(gap: float, h: float, physics: Physics) -> float:
    """Derivative of `bias` with respect to the gap."""
    if gap < -SHALLOW:
        return CORRECTION / h if bias(gap, h, physics) > -FASTEST_CORRECTION else 0.0
    if np.isinf(physics.kappa) or gap < -TOUCHING:
        return 1 / h
    return 0.0 if gap > TOUCHING else 0.5 / h


@njit(cache=True)
def row_multipliers(n: int, work: Work, impulse_adjoint: np.ndarray, w: np.ndarray) -> None:
    """Solve B^T w = adjoint of the impulses, for the equations of the active set; w is 0 on all other rows."""
    problem, mu = work.problem, work.contacts.friction
    size = reduced_system(n, problem, mu, True)
    row = 0
    for i in range(n):
        state = problem.state[i]
        if state == OPEN:
            continue
        value, tangential = impulse_adjoint[2 * i], impulse_adjoint[2 * i + 1]
        if state == STICK:
            problem.rhs[row + 1] = tangential
        else:
            value += mu[i] * tangential if state == SLIP_PLUS else -mu[i] * tangential
        problem.rhs[row] = value
        row += 2 if state == STICK else 1
    if not solve_linear(problem.B, problem.rhs, size):
        problem.rhs[:size] = 0
    w[: 2 * n] = 0
    row = 0
    for i in range(n):
        if problem.state[i] != OPEN:
            w[2 * i] = problem.rhs[row]
            row += 1
            if problem.state[i] == STICK:
                w[2 * i + 1] = problem.rhs[row]
                row += 1


@njit(cache=True)
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
    C = len(p)
    n, _ = solve_step(scene, physics, q, v, p, u, work)
    if scene.support > 0:
        guess = work.velocity.copy()
        friction = support_directions(scene, q, guess)
        support_mobility(scene, physics, q, v, guess, friction, work)
        assemble_problem(n, scene, physics, work)
    give = finger_mobility(scene, physics)
    J, D, W, finger = work.rows, work.directions, work.mobility, work.contacts.finger
    end = v_bar + h * q_bar
    ends = h * p_bar
    weighted = W @ end
    impulse_adjoint, w = np.zeros(2 * n), np.zeros(2 * n)
    for r in range(2 * n):
        impulse_adjoint[r] = J[r, 0] * weighted[0] + J[r, 1] * weighted[1] + J[r, 2] * weighted[2]
        if finger[r // 2] >= 0:
            f = finger[r // 2]
            impulse_adjoint[r] -= give * (D[r, 0] * ends[f, 0] + D[r, 1] * ends[f, 1])
    row_multipliers(n, work, impulse_adjoint, w)
    for r in range(2 * n):
        for d in range(3):
            end[d] -= w[r] * J[r, d]
        if finger[r // 2] >= 0:
            for d in range(2):
                ends[finger[r // 2], d] += w[r] * D[r, d]
    z = W @ end
    for i in range(n):
        _adjoint_contact(i, scene, physics, q, p, z, ends, w, q_bar, p_bar, work)
    if scene.support > 0:
        q_bar[2] += _adjoint_support(scene, physics, q, z, work)
    v_bar[0], v_bar[1], v_bar[2] = scene.mass * z[0], scene.mass * z[1], scene.inertia * z[2]
    follow = scene.stiffness / (scene.stiffness * h + physics.damping)
    for c in range(C):
        for d in range(2):
            u_bar[c, d] = follow * ends[c, d]
            p_bar[c, d] -= follow * ends[c, d]


@njit(cache=True)
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
    contacts, P, f = work.contacts, work.problem.P, work.contacts.finger[i]
    if P[2 * i] == 0 and w[2 * i] == 0:
        return
    h, give, gap = scene.dt / physics.substeps, finger_mobility(scene, physics), contacts.gap[i]
    soft, slope = softness(gap, physics), softness_slope(gap, physics)
    ax, ay = contacts.point[i, 0] - q[0], contacts.point[i, 1] - q[1]
    n_bar, arm_bar = np.zeros(2), np.zeros(2)
    gap_bar = -w[2 * i] * bias_slope(gap, h, physics)
    for part in range(2):
        r = 2 * i + part
        dx, dy = work.directions[r, 0], work.directions[r, 1]
        yx, yy = P[r] * z[0] - w[r] * work.velocity[0], P[r] * z[1] - w[r] * work.velocity[1]
        turn = P[r] * z[2] - w[r] * work.velocity[2]
        turn -= 2 * w[r] * P[r] * soft * work.rows[r, 2] / scene.inertia
        gap_bar -= w[r] * P[r] * slope * scale(r, scene, physics, work)
        ex, ey = yx - turn * ay, yy + turn * ax
        if f >= 0:
            ex += w[r] * work.finger_velocity[f, 0] - give * P[r] * ends[f, 0]
            ey += w[r] * work.finger_velocity[f, 1] - give * P[r] * ends[f, 1]
        arm_bar[0] += turn * dy
        arm_bar[1] -= turn * dx
        if part == 0:
            n_bar[0] += ex
            n_bar[1] += ey
        else:
            n_bar[0] += ey
            n_bar[1] -= ex
    q_bar[0] -= arm_bar[0]
    q_bar[1] -= arm_bar[1]
    _adjoint_geometry(i, scene, physics, q, p, n_bar, arm_bar, gap_bar, q_bar, p_bar, work)


@njit(cache=True)
def _adjoint_geometry(
    i: int,
    scene: View,
    physics: Physics,
    q: np.ndarray,
    p: np.ndarray,
    n_bar: np.ndarray,
    c_bar: np.ndarray,
    gap_bar: float,
    q_bar: np.ndarray,
    p_bar: np.ndarray,
    work: Work,
) -> None:
    """Adjoint of normal, contact point and gap with respect to the object's pose and the finger."""
    contacts = work.contacts
    k, f = contacts.feature[i], contacts.finger[i]
    cs, sn = np.cos(q[2]), np.sin(q[2])
    rx, ry = vertex_arm(scene, k, cs, sn)
    if contacts.kind[i] == WALL:
        gx, gy = c_bar[0] + gap_bar * contacts.normal[i, 0], c_bar[1] + gap_bar * contacts.normal[i, 1]
        _to_pose(gx, gy, rx, ry, q_bar)
        return
    ox, oy = -contacts.normal[i, 0], -contacts.normal[i, 1]
    sx, sy = p[f, 0] - q[0] - rx, p[f, 1] - q[1] - ry
    if contacts.kind[i] == FACET:
        distance = contacts.gap[i] + physics.radius
        distance_bar = gap_bar - c_bar[0] * ox - c_bar[1] * oy
        mx = distance_bar * sx - n_bar[0] - distance * c_bar[0]
        my = distance_bar * sy - n_bar[1] - distance * c_bar[1]
        p_bar[f, 0] += c_bar[0] + distance_bar * ox
        p_bar[f, 1] += c_bar[1] + distance_bar * oy
        _to_pose(-distance_bar * ox, -distance_bar * oy, rx, ry, q_bar)
        q_bar[2] += my * ox - mx * oy
        return
    sign, reach = contacts.sign[i], np.hypot(sx, sy)
    ex, ey = sx / reach, sy / reach
    along = -n_bar[0] * ex - n_bar[1] * ey
    gx = sign * ((-n_bar[0] - along * ex) / reach + gap_bar * ex)
    gy = sign * ((-n_bar[1] - along * ey) / reach + gap_bar * ey)
    p_bar[f, 0] += gx
    p_bar[f, 1] += gy
    _to_pose(c_bar[0] - gx, c_bar[1] - gy, rx, ry, q_bar)


@njit(cache=True)
def _to_pose(gx: float, gy: float, rx: float, ry: float, q_bar: np.ndarray) -> None:
    """Adjoint of a body point at arm (rx, ry)."""
    q_bar[0] += gx
    q_bar[1] += gy
    q_bar[2] += gy * rx - gx * ry


@njit(cache=True)
def _adjoint_support(scene: View, physics: Physics, q: np.ndarray, z: np.ndarray, work: Work) -> float:
    """Derivative of the support friction's impulse along z with respect to the object's angle."""
    h, v = scene.dt / physics.substeps, work.velocity
    cs, sn = np.cos(q[2]), np.sin(q[2])
    total = 0.0
    for k in range(len(scene.vertices)):
        rx, ry = vertex_arm(scene, k, cs, sn)
        sx, sy = v[0] - v[2] * ry, v[1] + v[2] * rx
        speed = np.sqrt(sx * sx + sy * sy + SUPPORT_CREEP**2)
        viscous = h * scene.support / speed
        zx, zy = z[0] - z[2] * ry, z[1] + z[2] * rx
        along = (zx * sx + zy * sy) / (speed * speed)
        total += z[2] * viscous * (rx * sx + ry * sy)
        total += v[2] * viscous * (rx * (zx - along * sx) + ry * (zy - along * sy))
    return total


@njit(cache=True, nogil=True)
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


@njit(cache=True, nogil=True)
def difference_batch(
    scenes: SceneArrays,
    physics: Physics,
    layers: Layers,
    positions: np.ndarray,
    forces: np.ndarray,
    loaded: np.ndarray,
    start: np.ndarray,
    adjoint: np.ndarray,
    step: float,
) -> tuple[np.ndarray, np.ndarray]:
    """The same by central differences: `step` [m] in positions, step * stiffness [N] in forces (the same commands).

    A rollout starts anew only from the substep at which its commands first differ from those of the plan.
    """
    B, T, C = loaded.shape
    gradient = np.zeros((2, B, T, C, 2))
    work = work_for(C, scenes.walls.shape[1])
    S = (T - 1) * layers.substeps
    base, other = motion_for(S + 1, C), motion_for(S + 1, C)
    commands, changed = np.zeros((S + 1, C, 2)), np.zeros((S + 1, C, 2))
    for b in range(B):
        if not acceptable(positions[b], forces[b]):
            continue
        scene = view(scenes, b)
        table = plan_commands(scene, scenes.path[b], positions[b], loaded[b], layers)
        command(table, positions[b], forces[b], scene.stiffness, commands)
        base.poses[0] = start[b]
        start_motion(table, positions[b], forces[b], base)
        if not advance(scene, physics, commands, 0, base, work):
            continue
        plan = np.stack((positions[b], forces[b]))
        for which in range(2):
            size = step if which == 0 else step * scene.stiffness
            for t in range(T):
                for c in range(C):
                    for d in range(2):
                        total = 0.0
                        kept = plan[which, t, c, d]
                        for sign in (1.0, -1.0):
                            plan[which, t, c, d] = kept + sign * size
                            if which == 0:
                                table = plan_commands(scene, scenes.path[b], plan[0], loaded[b], layers)
                            command(table, plan[0], plan[1], scene.stiffness, changed)
                            first = _restart(table, plan, commands, changed, base, other)
                            advance(scene, physics, changed, first, other, work)
                            for k in range(first // layers.substeps + 1, T):
                                i = k * layers.substeps
                                for e in range(3):
                                    total += sign * adjoint[b, k, e] * (other.poses[i, e] - base.poses[i, e])
                        plan[which, t, c, d] = kept
                        gradient[which, b, t, c, d] = total / (2 * size)
            if which == 0:
                table = plan_commands(scene, scenes.path[b], plan[0], loaded[b], layers)
    return gradient[0], gradient[1]


@njit(cache=True)
def _restart(
    table: Commands,
    plan: np.ndarray,
    commands: np.ndarray,
    changed: np.ndarray,
    base: Motion,
    other: Motion,
) -> int:
    """Substep from which the changed commands act, with the state there copied from the unchanged motion."""
    S = len(commands) - 1
    first = 0
    other.poses[0] = base.poses[0]
    start_motion(table, plan[0], plan[1], other)
    if not (other.fingers[0] == base.fingers[0]).all():
        return 0
    while first < S and (commands[first + 1] == changed[first + 1]).all():
        first += 1
    other.poses[first], other.velocities[first] = base.poses[first], base.velocities[first]
    other.fingers[first] = base.fingers[first]
    return first
