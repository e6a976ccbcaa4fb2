"""One time step (Thesis 4-CT8): velocities and impulses from a complementarity problem, then positions.

    M (v+ - v) = h g + J^T P + h (support friction)      q+ = q + h v+
    k (u+ - p+) + d ((u+ - u) / h - w) - P / h = 0       p+ = p + h w

A finger at p is a massless spring k with damper d that follows its command, from u to u+, at velocity w; P / h is its force
on the object.  The relative velocity J v+ - w at every contact and the impulses P solve the contact problem.

A step takes a microsecond: see `kernels`.
"""

from typing import NamedTuple

import numpy as np

from dlm.simulator import support
from dlm.simulator.contact import Moment, activation, collect
from dlm.simulator.kernels import borrowing, compiled, inlined
from dlm.simulator.lcp import solve_contacts
from dlm.simulator.problem import OPEN, Problem, problem_for
from dlm.simulator.world import State, World

SHALLOW = 1e-5
"""Penetrations up to here are removed within a step, like gaps: contacts that carry load have no kink about zero [m]."""
CORRECTION, FASTEST_CORRECTION = 0.2, 0.5
"""Share of a deeper penetration that one step removes, and the greatest speed at which [m/s]."""


class Work(NamedTuple):
    """Scratch memory of one step, and its results.

    mobility (3, 3): velocity per impulse.  Velocities of the object (3,): predicted without any forces
    but gravity, free of contacts, and at the end of the step; of the fingers (C, 2): free of contacts, and at the end.
    With friction of the support: resistance (3, 3) and momentum (3,), resistance v = momentum + impulses; the velocity that
    was guessed (3,), and directions (V, 2) that the friction opposes.
    """

    problem: Problem
    mobility: np.ndarray
    predicted: np.ndarray
    free: np.ndarray
    velocity: np.ndarray
    finger_free: np.ndarray
    finger_velocity: np.ndarray
    resistance: np.ndarray
    momentum: np.ndarray
    guess: np.ndarray
    directions: np.ndarray


@compiled
def work_for(fingers: int, walls: int, vertices: int) -> Work:
    """Scratch memory for scenes with at most so many: a finger touches two facets of a corner, a wall any vertex."""
    return Work(
        problem_for(2 * fingers + vertices * walls),
        np.zeros((3, 3)),
        np.zeros(3),
        np.zeros(3),
        np.zeros(3),
        np.zeros((fingers, 2)),
        np.zeros((fingers, 2)),
        np.zeros((3, 3)),
        np.zeros(3),
        np.zeros(3),
        np.zeros((vertices, 2)),
    )


@borrowing
def solve_step(world: World, state: State, commands: np.ndarray, work: Work) -> tuple[int, bool]:
    """Velocities at the end of the step, into work.velocity and work.finger_velocity.

    commands (2, C, 2): at the step's begin and end.  Returns the number of contacts and whether their problem was solved.
    """
    q, v, p = state
    predicted, finger_free = work.predicted, work.finger_free
    predicted[0], predicted[1], predicted[2] = v[0], v[1] - world.h * world.gravity, v[2]
    follow, lead = spring_rates(world)
    for c in range(len(p)):
        for d in range(2):
            u, target = commands[0, c, d], commands[1, c, d]
            finger_free[c, d] = follow * (target - p[c, d]) + lead * (target - u)
    now = Moment(q, np.cos(q[2]), np.sin(q[2]), predicted, p, finger_free)
    n = collect(world, now, work.problem.contacts)
    _contact_rows(n, q, work.problem)
    if world.support > 0:
        return n, _with_support(n, world, state, work)
    W, free = work.mobility, work.free
    for d in range(3):
        W[d, 0] = W[d, 1] = W[d, 2] = 0
        W[d, d] = 1 / (world.inertia if d == 2 else world.mass)
        free[d] = predicted[d]
    return n, _solve_velocities(n, world, work)


@inlined
def coasts(n: int, world: World, before: State, work: Work) -> bool:
    """Whether gravity alone acts in the step that was solved, and would if the mean of both velocities moved the object."""
    if world.support > 0:
        return False
    contacts, rows, _, _ = work.problem
    v, after = before.velocity, work.velocity
    for i in range(n):
        row = rows[2 * i]
        slower = row.x * (v[0] - after[0]) + row.y * (v[1] - after[1]) + row.turn * (v[2] - after[2])
        if contacts[i].state != OPEN or row.c + 0.5 * slower < 0:
            return False
    return True


@inlined
def _contact_rows(n: int, q: np.ndarray, problem: Problem) -> None:
    """Contact Jacobian: row 2 i is the normal direction of contact i, row 2 i + 1 the normal turned by +90 degrees."""
    contacts, rows = problem.contacts, problem.rows
    for i in range(n):
        nx, ny = contacts[i].nx, contacts[i].ny
        ax, ay = contacts[i].x - q[0], contacts[i].y - q[1]
        normal, tangent = rows[2 * i], rows[2 * i + 1]
        normal.x, normal.y, normal.turn = nx, ny, ax * ny - ay * nx
        tangent.x, tangent.y, tangent.turn = -ny, nx, ax * nx + ay * ny


@borrowing
def softness(gap: float, kappa: float, regularization: float) -> float:
    """Compliance of a contact over its scale: (1 - a) / a for activation a (Thesis 4-CT9), never below the floor."""
    if np.isinf(kappa):
        return regularization
    a = activation(gap, kappa)
    return regularization + (1 - a) / a


@borrowing
def bias(gap: float, h: float, kappa: float) -> float:
    """Velocity that the normal row adds: what closes an open gap, or what removes a share of a penetration."""
    if gap < -SHALLOW:
        return max((CORRECTION * (gap + SHALLOW) - SHALLOW) / h, -FASTEST_CORRECTION)
    return gap / h if gap < 0 or np.isinf(kappa) else 0.0


@borrowing
def finger_mobility(world: World) -> float:
    """Velocity of a finger per impulse on it."""
    return 1 / (world.h * (world.stiffness * world.h + world.damping))


@borrowing
def spring_rates(world: World) -> tuple[float, float]:
    """Velocity of a free finger per distance to its command, and per distance that the command goes in the step."""
    resistance = world.stiffness * world.h + world.damping
    return world.stiffness / resistance, world.damping / (resistance * world.h)


@borrowing
def contact_scale(world: World, lever: float, give: float) -> float:
    """What a row would have on the diagonal of A for a free object: the unit of the contact's compliance."""
    return 1 / world.mass + lever * lever / world.inertia + give


@inlined
def assemble_problem(n: int, world: World, work: Work) -> None:
    """A = J W J^T + finger mobility + compliance and c = relative velocity without impulses + bias."""
    contacts, rows, A, _ = work.problem
    W, free, finger_free, give = work.mobility, work.free, work.finger_free, finger_mobility(world)
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
        scale = contact_scale(world, row.turn, give if f >= 0 else 0.0)
        A[r, r] += scale * softness(contact.gap, world.kappa, world.regularization)
        c = row.x * free[0] + row.y * free[1] + row.turn * free[2]
        if f >= 0:
            c -= row.x * finger_free[f, 0] + row.y * finger_free[f, 1]
        row.c = c if r % 2 == 1 else c + bias(contact.gap, world.h, world.kappa)


@inlined
def _solve_velocities(n: int, world: World, work: Work) -> bool:
    """Solve the contact problem and apply its impulses."""
    exact = True
    if n > 0:
        assemble_problem(n, world, work)
        exact = solve_contacts(n, work.problem)
    _apply_impulses(n, world, work)
    return exact


@inlined
def _apply_impulses(n: int, world: World, work: Work) -> None:
    """Velocities of object and fingers from the impulses."""
    contacts, rows, _, _ = work.problem
    velocity, free, finger_velocity = work.velocity, work.free, work.finger_velocity
    give = finger_mobility(world)
    for c in range(len(finger_velocity)):
        finger_velocity[c, 0], finger_velocity[c, 1] = work.finger_free[c, 0], work.finger_free[c, 1]
    x, y, turn = 0.0, 0.0, 0.0
    for r in range(2 * n):
        row, f = rows[r], contacts[r // 2].finger
        x += row.x * row.P
        y += row.y * row.P
        turn += row.turn * row.P
        if f >= 0:
            finger_velocity[f, 0] -= give * row.x * row.P
            finger_velocity[f, 1] -= give * row.y * row.P
    W = work.mobility
    for k in range(3):
        velocity[k] = free[k] + W[k, 0] * x + W[k, 1] * y + W[k, 2] * turn


@borrowing
def _with_support(n: int, world: World, state: State, work: Work) -> bool:
    """Contacts and support friction together, by Newton steps in velocity and friction."""
    for d in range(3):
        work.guess[d] = work.predicted[d]
    support.directions(world, state.pose, work.guess, work.directions)
    exact = True
    for _ in range(support.ITERATIONS):
        support_mobility(world, state, work)
        exact = _solve_velocities(n, world, work)
        change = support.update_directions(world, state.pose, work.guess, work.velocity, work.directions)
        for d in range(3):
            work.guess[d] = work.velocity[d]
        if change < support.TOLERANCE:
            return exact
    return False


@borrowing
def support_mobility(world: World, state: State, work: Work) -> None:
    """Mobility and contact-free velocity with the support friction linearised at the guess and its directions."""
    W, b = work.mobility, work.momentum
    for d in range(3):
        b[d] = (world.inertia if d == 2 else world.mass) * state.velocity[d]
    support.linearise(world, state.pose, work.guess, work.directions, (work.resistance, b))
    support.invert(work.resistance, W)
    for d in range(3):
        work.free[d] = W[d, 0] * b[0] + W[d, 1] * b[1] + W[d, 2] * b[2]
