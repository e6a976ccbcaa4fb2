"""One time step (Thesis 4-CT8): velocities and impulses from a complementarity problem, then positions.

    M (v+ - v) = h g + J^T P + h (support friction)      q+ = q + h v+
    k (u - p+) - d w - P / h = 0                         p+ = p + h w

A finger at p is a massless spring k with damper d that follows its command u at velocity w; P / h is its force on the
object.  The relative velocity J v+ - w at every contact and the impulses P solve the problem of `lcp`.

A step takes a microsecond.  Numba counts references of every array that a call passes, so the small functions of the
inner loop are inlined; that halves the time.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from dlm.simulator.contact import CONTACT, WALL_POINTS, View, activation, collect
from dlm.simulator.lcp import ROW, solve_contacts
from dlm.simulator.settings import Physics

SHALLOW = 1e-5
"""Penetrations up to here are removed within a step, like gaps: contacts that carry load have no kink about zero [m]."""
CORRECTION, FASTEST_CORRECTION = 0.2, 0.5
"""Share of a deeper penetration that one step removes, and the greatest speed at which [m/s]."""
SUPPORT_CREEP = 1e-5
"""Support friction is Coulomb's above this speed and viscous below it [m/s]."""
SUPPORT_ITERATIONS, SUPPORT_TOLERANCE = 60, 1e-13


class Work(NamedTuple):
    """Scratch memory of one step, and its results.

    contacts (n,) of CONTACT, rows (2 n,) of ROW, A and B (2 n, 2 n): see `lcp`.  mobility (3, 3): velocity per impulse.
    Velocities of the object (3,): predicted without any forces but gravity, free of contacts, and at the end of the step;
    of the fingers (C, 2): free of contacts, and at the end.
    """

    contacts: np.ndarray
    rows: np.ndarray
    A: np.ndarray
    B: np.ndarray
    mobility: np.ndarray
    predicted: np.ndarray
    free: np.ndarray
    velocity: np.ndarray
    finger_free: np.ndarray
    finger_velocity: np.ndarray


@njit(cache=True, error_model="numpy")
def work_for(fingers: int, walls: int) -> Work:
    """Scratch memory for scenes with at most so many fingers and walls."""
    size = 2 * fingers + WALL_POINTS * walls
    return Work(
        np.zeros(size, CONTACT),
        np.zeros(2 * size, ROW),
        np.zeros((2 * size, 2 * size)),
        np.zeros((2 * size, 2 * size)),
        np.zeros((3, 3)),
        np.zeros(3),
        np.zeros(3),
        np.zeros(3),
        np.zeros((fingers, 2)),
        np.zeros((fingers, 2)),
    )


@njit(cache=True, error_model="numpy")
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
    work.predicted[0], work.predicted[1], work.predicted[2] = v[0], v[1] - h * scene.gravity, v[2]
    follow = scene.stiffness / (scene.stiffness * h + physics.damping)
    for c in range(len(p)):
        work.finger_free[c, 0] = follow * (u[c, 0] - p[c, 0])
        work.finger_free[c, 1] = follow * (u[c, 1] - p[c, 1])
    n = collect(scene, physics, q, work.predicted, p, work.finger_free, work.contacts)
    _contact_rows(n, q, work.contacts, work.rows)
    if scene.support > 0:
        return n, _with_support(n, scene, physics, q, v, work)
    for d in range(3):
        work.mobility[d, :] = 0
        work.mobility[d, d] = 1 / (scene.inertia if d == 2 else scene.mass)
        work.free[d] = work.predicted[d]
    return n, _solve_velocities(n, scene, physics, work)


@njit(cache=True, error_model="numpy", inline="always")
def _contact_rows(n: int, q: np.ndarray, contacts: np.ndarray, rows: np.ndarray) -> None:
    """Contact Jacobian: row 2 i is the normal direction of contact i, row 2 i + 1 the normal turned by +90 degrees."""
    for i in range(n):
        nx, ny = contacts[i].nx, contacts[i].ny
        ax, ay = contacts[i].x - q[0], contacts[i].y - q[1]
        normal, tangent = rows[2 * i], rows[2 * i + 1]
        normal.x, normal.y, normal.turn = nx, ny, ax * ny - ay * nx
        tangent.x, tangent.y, tangent.turn = -ny, nx, ax * nx + ay * ny


@njit(cache=True, error_model="numpy")
def softness(gap: float, kappa: float, regularization: float) -> float:
    """Compliance of a contact over its scale: (1 - a) / a for activation a, never below the floor."""
    if np.isinf(kappa):
        return regularization
    a = activation(gap, kappa)
    return regularization + (1 - a) / a


@njit(cache=True, error_model="numpy")
def bias(gap: float, h: float, kappa: float) -> float:
    """Velocity that the normal row adds: what closes an open gap, or what removes a share of a penetration."""
    if gap < -SHALLOW:
        return max((CORRECTION * (gap + SHALLOW) - SHALLOW) / h, -FASTEST_CORRECTION)
    return gap / h if gap < 0 or np.isinf(kappa) else 0.0


@njit(cache=True, error_model="numpy")
def finger_mobility(stiffness: float, damping: float, h: float) -> float:
    """Velocity of a finger per impulse on it."""
    return 1 / (h * (stiffness * h + damping))


@njit(cache=True, error_model="numpy")
def contact_scale(mass: float, inertia: float, lever: float, give: float) -> float:
    """What a row would have on the diagonal of A for a free object: the unit of the contact's compliance."""
    return 1 / mass + lever * lever / inertia + give


@njit(cache=True, error_model="numpy", inline="always")
def assemble_problem(n: int, scene: View, physics: Physics, work: Work) -> None:
    """A = J W J^T + finger mobility + compliance and c = relative velocity without impulses + bias."""
    h = scene.dt / physics.substeps
    give = finger_mobility(scene.stiffness, physics.damping, h)
    A, W, rows, contacts = work.A, work.mobility, work.rows, work.contacts
    for r in range(2 * n):
        row, contact = rows[r], contacts[r // 2]
        f = contact.finger
        w0 = row.x * W[0, 0] + row.y * W[1, 0] + row.turn * W[2, 0]
        w1 = row.x * W[0, 1] + row.y * W[1, 1] + row.turn * W[2, 1]
        w2 = row.x * W[0, 2] + row.y * W[1, 2] + row.turn * W[2, 2]
        for s in range(r + 1):
            other = rows[s]
            value = w0 * other.x + w1 * other.y + w2 * other.turn
            if f >= 0 and contacts[s // 2].finger == f:
                value += give * (row.x * other.x + row.y * other.y)
            A[r, s] = A[s, r] = value
        scale = contact_scale(scene.mass, scene.inertia, row.turn, give if f >= 0 else 0.0)
        A[r, r] += scale * softness(contact.gap, physics.kappa, physics.regularization)
        c = row.x * work.free[0] + row.y * work.free[1] + row.turn * work.free[2]
        if f >= 0:
            c -= row.x * work.finger_free[f, 0] + row.y * work.finger_free[f, 1]
        row.c = c if r % 2 == 1 else c + bias(contact.gap, h, physics.kappa)


@njit(cache=True, error_model="numpy", inline="always")
def _solve_velocities(n: int, scene: View, physics: Physics, work: Work) -> bool:
    """Solve the contact problem and apply its impulses."""
    exact = True
    if n > 0:
        assemble_problem(n, scene, physics, work)
        exact = solve_contacts(n, work.contacts, work.rows, work.A, work.B)
    _apply_impulses(n, scene, physics, work)
    return exact


@njit(cache=True, error_model="numpy", inline="always")
def _apply_impulses(n: int, scene: View, physics: Physics, work: Work) -> None:
    """Velocities of object and fingers from the impulses."""
    give = finger_mobility(scene.stiffness, physics.damping, scene.dt / physics.substeps)
    work.finger_velocity[:] = work.finger_free
    x, y, turn = 0.0, 0.0, 0.0
    for r in range(2 * n):
        row, f = work.rows[r], work.contacts[r // 2].finger
        x += row.x * row.P
        y += row.y * row.P
        turn += row.turn * row.P
        if f >= 0:
            work.finger_velocity[f, 0] -= give * row.x * row.P
            work.finger_velocity[f, 1] -= give * row.y * row.P
    W = work.mobility
    for k in range(3):
        work.velocity[k] = work.free[k] + W[k, 0] * x + W[k, 1] * y + W[k, 2] * turn


@njit(cache=True, error_model="numpy")
def _with_support(n: int, scene: View, physics: Physics, q: np.ndarray, v: np.ndarray, work: Work) -> bool:
    """Contacts and support friction together, by Newton steps in velocity and friction (Chan, Golub, Mulet).

    Every vertex, at velocity s, takes the friction -F w with w = s / sqrt(|s|^2 + creep^2).  Keeping w as an unknown of
    its own, within the unit disc, lets Newton's method converge from afar.
    """
    guess = work.predicted.copy()
    friction = support_directions(scene.facets, q, guess)
    exact = True
    for _ in range(SUPPORT_ITERATIONS):
        support_mobility(scene, physics, q, v, guess, friction, work)
        exact = _solve_velocities(n, scene, physics, work)
        change = _update_directions(scene.facets, q, guess, work.velocity, friction)
        guess[:] = work.velocity
        if change < SUPPORT_TOLERANCE:
            return exact
    return False


@njit(cache=True, error_model="numpy")
def vertex_arm(x: float, y: float, cs: float, sn: float) -> tuple[float, float]:
    """A vertex seen from the centre of mass, world frame, for cosine and sine of the object's angle."""
    return cs * x - sn * y, sn * x + cs * y


@njit(cache=True, error_model="numpy")
def support_directions(facets: np.ndarray, q: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """Directions w (V, 2) that the support friction opposes."""
    w = np.zeros((len(facets), 2))
    cs, sn = np.cos(q[2]), np.sin(q[2])
    for k in range(len(w)):
        rx, ry = vertex_arm(facets[k].x, facets[k].y, cs, sn)
        sx, sy = velocity[0] - ry * velocity[2], velocity[1] + rx * velocity[2]
        speed = np.sqrt(sx * sx + sy * sy + SUPPORT_CREEP**2)
        w[k, 0], w[k, 1] = sx / speed, sy / speed
    return w


@njit(cache=True, error_model="numpy")
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
    for k in range(len(scene.facets)):
        rx, ry = vertex_arm(scene.facets[k].x, scene.facets[k].y, cs, sn)
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


@njit(cache=True, error_model="numpy")
def _update_directions(
    facets: np.ndarray, q: np.ndarray, before: np.ndarray, after: np.ndarray, friction: np.ndarray
) -> float:
    """Newton step of the directions w, drawn back into the unit disc; returns the largest change of a vertex velocity."""
    cs, sn = np.cos(q[2]), np.sin(q[2])
    largest = 0.0
    for k in range(len(friction)):
        rx, ry = vertex_arm(facets[k].x, facets[k].y, cs, sn)
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
