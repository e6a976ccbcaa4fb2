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


BODY = np.dtype(
    [(name, "f8", 3) for name in ("predicted", "free", "velocity", "guess", "momentum")]
    + [(name, "f8", (3, 3)) for name in ("mobility", "resistance")]
)
"""Velocities of the object: predicted without any forces but gravity, free of contacts, at the end of the step; mobility:
velocity per impulse.  With friction of the support: resistance velocity = momentum + impulses, linearised at a guess."""


class Work(NamedTuple):
    """Scratch memory of one step, and its results.

    body (1,) of BODY, in one piece because calls pass arrays one by one.  Velocities of the fingers (C, 2): free of contacts,
    and at the end of the step.  directions (V, 2) that the friction of the support opposes.
    """

    problem: Problem
    body: np.ndarray
    finger_free: np.ndarray
    finger_velocity: np.ndarray
    directions: np.ndarray


@compiled
def work_for(fingers: int, walls: int, vertices: int) -> Work:
    """Scratch memory for scenes with at most so many: a finger touches two facets of a corner, a wall any vertex."""
    return Work(
        problem_for(2 * fingers + vertices * walls),
        np.zeros(1, BODY),
        np.zeros((fingers, 2)),
        np.zeros((fingers, 2)),
        np.zeros((vertices, 2)),
    )


@inlined
def solve_step(world: World, state: State, commands: np.ndarray, work: Work) -> tuple[int, bool]:
    """Velocities at the end of the step, into work.body and work.finger_velocity.

    commands (2, C, 2): at the step's begin and end.  Returns the number of contacts and whether their problem was solved.
    """
    q, v, p = state
    predicted, finger_free = work.body[0].predicted, work.finger_free
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
    W, free = work.body[0].mobility, work.body[0].free
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
    v, after = before.velocity, work.body[0].velocity
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
    W, free = work.body[0].mobility, work.body[0].free
    finger_free, give = work.finger_free, finger_mobility(world)
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
    body, finger_velocity = work.body[0], work.finger_velocity
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
    velocity, W = body.velocity, body.mobility
    for k in range(3):
        velocity[k] = body.free[k] + W[k, 0] * x + W[k, 1] * y + W[k, 2] * turn


@inlined
def _with_support(n: int, world: World, state: State, work: Work) -> bool:
    """Contacts and support friction together, by Newton steps in velocity and friction."""
    body, w, exact = work.body[0], work.directions, True
    for d in range(3):
        body.guess[d] = body.predicted[d]
    support.directions(world, state.pose, body.guess, w)
    for _ in range(support.ITERATIONS):
        support_mobility(world, state, work)
        exact = _solve_velocities(n, world, work)
        change = support.update_directions(world, state.pose, body.guess, body.velocity, w)
        for d in range(3):
            body.guess[d] = body.velocity[d]
        if change < support.TOLERANCE:
            return exact
    return False


@inlined
def support_mobility(world: World, state: State, work: Work) -> None:
    """Mobility and contact-free velocity with the support friction linearised at the guess and its directions."""
    body = work.body[0]
    W, b = body.mobility, body.momentum
    for d in range(3):
        b[d] = (world.inertia if d == 2 else world.mass) * state.velocity[d]
    support.linearise(world, state.pose, body.guess, work.directions, (body.resistance, b))
    support.invert(body.resistance, W)
    for d in range(3):
        body.free[d] = W[d, 0] * b[0] + W[d, 1] * b[1] + W[d, 2] * b[2]
