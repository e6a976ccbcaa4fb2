"""One time step (Thesis 4-CT8): velocities and impulses from a complementarity problem, then positions.

    M (v+ - v) = h g + J^T P + h (support friction)      q+ = q + h v+
    k (u - p+) - d w - P / h = 0                         p+ = p + h w

A finger at p is a massless spring k with damper d that follows its command u at velocity w; P / h is its force on the
object.  The relative velocity J v+ - w at every contact and the impulses P solve the problem of `lcp`.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from dlm.simulator.contact import WALL_POINTS, Contacts, View, activation, collect, contacts_for
from dlm.simulator.lcp import Complementarity, complementarity_for, solve_contacts
from dlm.simulator.settings import Physics

SHALLOW = 1e-5
"""Penetrations up to here are removed within a step, like gaps: contacts that carry load have no kink about zero [m]."""
CORRECTION, FASTEST_CORRECTION = 0.2, 0.5
"""Share of a deeper penetration that one step removes, and the greatest speed at which [m/s]."""
SUPPORT_CREEP = 1e-5
"""Support friction is Coulomb's above this speed and viscous below it [m/s]."""
SUPPORT_ITERATIONS, SUPPORT_TOLERANCE = 60, 1e-13


class Work(NamedTuple):
    """Scratch memory of one step, and its results: velocity (3,), finger velocities (C, 2), contacts and impulses."""

    contacts: Contacts
    problem: Complementarity
    rows: np.ndarray
    directions: np.ndarray
    mobility: np.ndarray
    free: np.ndarray
    predicted: np.ndarray
    velocity: np.ndarray
    finger_free: np.ndarray
    finger_velocity: np.ndarray


@njit(cache=True)
def work_for(fingers: int, walls: int) -> Work:
    """Scratch memory for scenes with at most so many fingers and walls."""
    size = 2 * fingers + WALL_POINTS * walls
    return Work(
        contacts_for(size),
        complementarity_for(size),
        np.zeros((2 * size, 3)),
        np.zeros((2 * size, 2)),
        np.zeros((3, 3)),
        np.zeros(3),
        np.zeros(3),
        np.zeros(3),
        np.zeros((fingers, 2)),
        np.zeros((fingers, 2)),
    )


@njit(cache=True)
def solve_step(
    scene: View,
    physics: Physics,
    q: np.ndarray,
    v: np.ndarray,
    p: np.ndarray,
    u: np.ndarray,
    work: Work,
) -> tuple[int, bool]:
    """Velocities at the end of the step, into work.velocity and work.finger_velocity.

    Pose q (3,), velocity v (3,), finger positions p (C, 2), commands u (C, 2).  Returns the number of contacts and
    whether their problem was solved exactly.
    """
    h = scene.dt / physics.substeps
    work.predicted[:] = v
    work.predicted[1] -= h * scene.gravity
    follow = scene.stiffness / (scene.stiffness * h + physics.damping)
    for c in range(len(p)):
        for d in range(2):
            work.finger_free[c, d] = follow * (u[c, d] - p[c, d])
    n = collect(scene, physics, q, work.predicted, p, work.finger_free, work.contacts)
    assemble_rows(n, q, work)
    if scene.support == 0:
        work.mobility[:] = 0
        work.mobility[0, 0] = work.mobility[1, 1] = 1 / scene.mass
        work.mobility[2, 2] = 1 / scene.inertia
        work.free[:] = work.predicted
        exact = _velocities(n, scene, physics, work)
    else:
        exact = _with_support(n, scene, physics, q, v, work)
    return n, exact


@njit(cache=True)
def assemble_rows(n: int, q: np.ndarray, work: Work) -> None:
    """Contact Jacobian (2 n, 3) and directions (2 n, 2)."""
    for i in range(n):
        nx, ny = work.contacts.normal[i, 0], work.contacts.normal[i, 1]
        ax, ay = work.contacts.point[i, 0] - q[0], work.contacts.point[i, 1] - q[1]
        for r, dx, dy in ((2 * i, nx, ny), (2 * i + 1, -ny, nx)):
            work.directions[r, 0] = work.rows[r, 0] = dx
            work.directions[r, 1] = work.rows[r, 1] = dy
            work.rows[r, 2] = ax * dy - ay * dx


@njit(cache=True)
def softness(gap: float, physics: Physics) -> float:
    """Compliance of a contact over its scale: (1 - a) / a for activation a, never below the floor."""
    if np.isinf(physics.kappa):
        return physics.regularization
    a = activation(gap, physics.kappa)
    return physics.regularization + (1 - a) / a


@njit(cache=True)
def bias(gap: float, h: float, physics: Physics) -> float:
    """Velocity that the normal row adds: what closes an open gap, or what removes a share of a penetration."""
    if gap < -SHALLOW:
        return max((CORRECTION * (gap + SHALLOW) - SHALLOW) / h, -FASTEST_CORRECTION)
    return gap / h if gap < 0 or np.isinf(physics.kappa) else 0.0


@njit(cache=True)
def finger_mobility(scene: View, physics: Physics) -> float:
    """Velocity of a finger per impulse on it."""
    h = scene.dt / physics.substeps
    return 1 / (h * (scene.stiffness * h + physics.damping))


@njit(cache=True)
def scale(r: int, scene: View, physics: Physics, work: Work) -> float:
    """What row r of the problem would have on its diagonal for a free object: the unit of the contact's compliance."""
    value = 1 / scene.mass + work.rows[r, 2] ** 2 / scene.inertia
    return value + finger_mobility(scene, physics) if work.contacts.finger[r // 2] >= 0 else value


@njit(cache=True)
def assemble_problem(n: int, scene: View, physics: Physics, work: Work) -> None:
    """A = J W J^T + finger mobility + compliance and c = relative velocity without impulses + bias."""
    h = scene.dt / physics.substeps
    give = finger_mobility(scene, physics)
    A, c, J, D, W = work.problem.A, work.problem.c, work.rows, work.directions, work.mobility
    for r in range(2 * n):
        i, f = r // 2, work.contacts.finger[r // 2]
        w0 = J[r, 0] * W[0, 0] + J[r, 1] * W[1, 0] + J[r, 2] * W[2, 0]
        w1 = J[r, 0] * W[0, 1] + J[r, 1] * W[1, 1] + J[r, 2] * W[2, 1]
        w2 = J[r, 0] * W[0, 2] + J[r, 1] * W[1, 2] + J[r, 2] * W[2, 2]
        for s in range(r + 1):
            value = w0 * J[s, 0] + w1 * J[s, 1] + w2 * J[s, 2]
            if f >= 0 and work.contacts.finger[s // 2] == f:
                value += give * (D[r, 0] * D[s, 0] + D[r, 1] * D[s, 1])
            A[r, s] = A[s, r] = value
        A[r, r] += softness(work.contacts.gap[i], physics) * scale(r, scene, physics, work)
        c[r] = J[r, 0] * work.free[0] + J[r, 1] * work.free[1] + J[r, 2] * work.free[2]
        if f >= 0:
            c[r] -= D[r, 0] * work.finger_free[f, 0] + D[r, 1] * work.finger_free[f, 1]
        if r % 2 == 0:
            c[r] += bias(work.contacts.gap[i], h, physics)


@njit(cache=True)
def _velocities(n: int, scene: View, physics: Physics, work: Work) -> bool:
    """Solve the contact problem and apply its impulses."""
    exact = True
    if n > 0:
        assemble_problem(n, scene, physics, work)
        exact = solve_contacts(n, work.problem, work.contacts.friction)
    apply_impulses(n, scene, physics, work)
    return exact


@njit(cache=True)
def apply_impulses(n: int, scene: View, physics: Physics, work: Work) -> None:
    """Velocities of object and fingers from the impulses in work.problem.P."""
    give = finger_mobility(scene, physics)
    work.velocity[:] = work.free
    work.finger_velocity[:] = work.finger_free
    for r in range(2 * n):
        P, f = work.problem.P[r], work.contacts.finger[r // 2]
        for k in range(3):
            for j in range(3):
                work.velocity[k] += work.mobility[k, j] * work.rows[r, j] * P
        if f >= 0:
            work.finger_velocity[f, 0] -= give * work.directions[r, 0] * P
            work.finger_velocity[f, 1] -= give * work.directions[r, 1] * P


@njit(cache=True)
def _with_support(n: int, scene: View, physics: Physics, q: np.ndarray, v: np.ndarray, work: Work) -> bool:
    """Contacts and support friction together, by Newton steps in velocity and friction (Chan, Golub, Mulet).

    Every vertex, at velocity s, takes the friction -F w with w = s / sqrt(|s|^2 + creep^2).  Keeping w as an unknown of
    its own, within the unit disc, lets Newton's method converge from afar.
    """
    guess = work.predicted.copy()
    friction = support_directions(scene, q, guess)
    exact = True
    for _ in range(SUPPORT_ITERATIONS):
        support_mobility(scene, physics, q, v, guess, friction, work)
        exact = _velocities(n, scene, physics, work)
        change = _update_directions(scene, q, guess, work.velocity, friction)
        guess[:] = work.velocity
        if change < SUPPORT_TOLERANCE:
            return exact
    return False


@njit(cache=True, inline="always")
def vertex_arm(scene: View, k: int, cs: float, sn: float) -> tuple[float, float]:
    """Vertex k seen from the centre of mass, world frame, for cosine and sine of the object's angle."""
    x, y = scene.vertices[k, 0], scene.vertices[k, 1]
    return cs * x - sn * y, sn * x + cs * y


@njit(cache=True)
def support_directions(scene: View, q: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """Directions w (V, 2) that the support friction opposes."""
    w = np.zeros((len(scene.vertices), 2))
    cs, sn = np.cos(q[2]), np.sin(q[2])
    for k in range(len(w)):
        rx, ry = vertex_arm(scene, k, cs, sn)
        sx, sy = velocity[0] - ry * velocity[2], velocity[1] + rx * velocity[2]
        speed = np.sqrt(sx * sx + sy * sy + SUPPORT_CREEP**2)
        w[k, 0], w[k, 1] = sx / speed, sy / speed
    return w


@njit(cache=True)
def support_mobility(
    scene: View,
    physics: Physics,
    q: np.ndarray,
    v: np.ndarray,
    guess: np.ndarray,
    friction: np.ndarray,
    work: Work,
) -> None:
    """Mobility and contact-free velocity with the support friction linearised at a velocity and its directions w."""
    h = scene.dt / physics.substeps
    K, b, S, D = np.zeros((3, 3)), np.zeros(3), np.zeros((2, 3)), np.zeros((2, 2))
    K[0, 0] = K[1, 1] = scene.mass
    K[2, 2] = scene.inertia
    b[0], b[1], b[2] = scene.mass * v[0], scene.mass * v[1], scene.inertia * v[2]
    cs, sn = np.cos(q[2]), np.sin(q[2])
    S[0, 0] = S[1, 1] = 1
    for k in range(len(scene.vertices)):
        rx, ry = vertex_arm(scene, k, cs, sn)
        S[0, 2], S[1, 2] = -ry, rx
        sx, sy = guess[0] - ry * guess[2], guess[1] + rx * guess[2]
        speed = np.sqrt(sx * sx + sy * sy + SUPPORT_CREEP**2)
        viscous = h * scene.support / speed
        wx, wy = friction[k, 0], friction[k, 1]
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
    invert(K, work.mobility)
    for i in range(3):
        work.free[i] = work.mobility[i, 0] * b[0] + work.mobility[i, 1] * b[1] + work.mobility[i, 2] * b[2]


@njit(cache=True)
def _update_directions(
    scene: View, q: np.ndarray, before: np.ndarray, after: np.ndarray, friction: np.ndarray
) -> float:
    """Newton step of the directions w, drawn back into the unit disc; returns the largest change of a vertex velocity."""
    cs, sn = np.cos(q[2]), np.sin(q[2])
    largest = 0.0
    for k in range(len(friction)):
        rx, ry = vertex_arm(scene, k, cs, sn)
        sx, sy = before[0] - ry * before[2], before[1] + rx * before[2]
        dx = after[0] - ry * after[2] - sx
        dy = after[1] + rx * after[2] - sy
        speed = np.sqrt(sx * sx + sy * sy + SUPPORT_CREEP**2)
        along = (sx * dx + sy * dy) / speed
        wx = (sx + dx - friction[k, 0] * along) / speed
        wy = (sy + dy - friction[k, 1] * along) / speed
        length = max(1.0, np.sqrt(wx * wx + wy * wy))
        friction[k, 0], friction[k, 1] = wx / length, wy / length
        largest = max(largest, abs(dx), abs(dy))
    return largest


@njit(cache=True)
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
