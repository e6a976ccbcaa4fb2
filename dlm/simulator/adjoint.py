"""Adjoint of the time step by the implicit function theorem.

With the active set known, the impulses solve linear equations B P + c = 0; their derivative needs one solve with B^T.
What remains is the chain rule through the contact geometry, kept here in the order of the forward computation reversed.
"""

from typing import NamedTuple

import numpy as np

from dlm.simulator import support
from dlm.simulator.contact import FACET, WALL
from dlm.simulator.kernels import borrowing, compiled, inlined
from dlm.simulator.problem import OPEN, SLIP_PLUS, STICK, Problem, reduced_system, solve_linear
from dlm.simulator.step import (
    CORRECTION,
    FASTEST_CORRECTION,
    SHALLOW,
    Work,
    assemble_problem,
    bias,
    coasts,
    contact_scale,
    finger_mobility,
    softness,
    solve_step,
    spring_rates,
    support_mobility,
)
from dlm.simulator.world import State, World, vertex_arm

TOUCHING = 1e-12
"""Plans start with fingers that touch: there smoothed contacts have a kink, and the mean of both slopes is taken [m]."""


class Back(NamedTuple):
    """Adjoints that the contacts share: z (3,) of the object's momentum, ends (C, 2) of the fingers, w (2 n,) of the rows."""

    z: np.ndarray
    ends: np.ndarray
    w: np.ndarray


class ContactBar(NamedTuple):
    """Adjoints of a contact's normal, point and gap."""

    nx: float
    ny: float
    x: float
    y: float
    gap: float


@borrowing
def softness_slope(gap: float, kappa: float) -> float:
    """Derivative of `softness` with respect to the gap: (1 - a) / a = (exp(kappa gap) - 1) / 2 where the gap is open."""
    if np.isinf(kappa) or gap < -TOUCHING or kappa * gap > 500:
        return 0.0
    slope = 0.5 * kappa * np.exp(kappa * gap)
    return slope if gap > TOUCHING else slope / 2


@borrowing
def bias_slope(gap: float, h: float, kappa: float) -> float:
    """Derivative of `bias` with respect to the gap."""
    if gap < -SHALLOW:
        return CORRECTION / h if bias(gap, h, kappa) > -FASTEST_CORRECTION else 0.0
    if np.isinf(kappa) or gap < -TOUCHING:
        return 1 / h
    return 0.0 if gap > TOUCHING else 0.5 / h


@compiled
def adjoint_step(
    world: World, state: State, commands: np.ndarray, bar: State, command_bar: np.ndarray, work: Work
) -> None:
    """Turn the adjoints `bar` of the state after the step into those before it, in place; add to the commands' (2, C, 2)."""
    n, _ = solve_step(world, state, commands, work)
    early = 0.5 * world.h if coasts(n, world, state, work) else 0.0
    if world.support > 0:
        _linearise_support(n, world, state, work)
    end, ends = bar.velocity + (world.h - early) * bar.pose, world.h * bar.fingers
    w = row_multipliers(n, work.problem, impulse_adjoint(n, world, end, ends, work))
    contacts, rows, _, _ = work.problem
    for r in range(2 * n):
        row, f = rows[r], contacts[r // 2].finger
        end[0] -= w[r] * row.x
        end[1] -= w[r] * row.y
        end[2] -= w[r] * row.turn
        if f >= 0:
            ends[f, 0] += w[r] * row.x
            ends[f, 1] += w[r] * row.y
    back = Back(work.body[0].mobility @ end, ends, w)
    pose_bar = bar.pose.copy()
    for i in range(n):
        if rows[2 * i].P != 0 or w[2 * i] != 0:
            _adjoint_contact(i, world, state, back, bar, work)
    if world.support > 0:
        bar.pose[2] += support.turning_slope(world, state.pose, back.z, work.body[0].velocity)
    for d in range(3):
        bar.velocity[d] = (world.inertia if d == 2 else world.mass) * back.z[d] + early * pose_bar[d]
    follow, lead = spring_rates(world)
    for c in range(len(ends)):
        for d in range(2):
            command_bar[1, c, d] += (follow + lead) * ends[c, d]
            command_bar[0, c, d] -= lead * ends[c, d]
            bar.fingers[c, d] -= follow * ends[c, d]


@compiled
def _linearise_support(n: int, world: World, state: State, work: Work) -> None:
    """The contact problem with the support friction linearised at the velocity that was found."""
    for d in range(3):
        work.body[0].guess[d] = work.body[0].velocity[d]
    support.directions(world, state.pose, work.body[0].guess, work.directions)
    support_mobility(world, state, work)
    assemble_problem(n, world, work)


@compiled
def impulse_adjoint(n: int, world: World, end: np.ndarray, ends: np.ndarray, work: Work) -> np.ndarray:
    """Adjoints (2 n,) of the impulses, given those of the velocities of object (3,) and fingers (C, 2)."""
    weighted, out, give = work.body[0].mobility @ end, np.zeros(2 * n), finger_mobility(world)
    contacts, rows, _, _ = work.problem
    for r in range(2 * n):
        row, f = rows[r], contacts[r // 2].finger
        out[r] = row.x * weighted[0] + row.y * weighted[1] + row.turn * weighted[2]
        if f >= 0:
            out[r] -= give * (row.x * ends[f, 0] + row.y * ends[f, 1])
    return out


@compiled
def row_multipliers(n: int, problem: Problem, adjoint: np.ndarray) -> np.ndarray:
    """w (2 n,) with B^T w = adjoint of the impulses, for the equations of the active set, and 0 on all other rows."""
    contacts, rows = problem.contacts, problem.rows
    size = reduced_system(n, problem, True)
    row = 0
    for i in range(n):
        state, mu = contacts[i].state, contacts[i].friction
        value, tangential = adjoint[2 * i], adjoint[2 * i + 1]
        if state == OPEN:
            continue
        if state == STICK:
            rows[row + 1].rhs = tangential
        else:
            value += mu * tangential if state == SLIP_PLUS else -mu * tangential
        rows[row].rhs = value
        row += 2 if state == STICK else 1
    regular = solve_linear(problem.B, rows, size)
    w = np.zeros(2 * n)
    row = 0
    for i in range(n):
        if regular and contacts[i].state != OPEN:
            w[2 * i] = rows[row].rhs
            row += 1
            if contacts[i].state == STICK:
                w[2 * i + 1] = rows[row].rhs
                row += 1
    return w


@inlined
def _adjoint_contact(i: int, world: World, state: State, back: Back, bar: State, work: Work) -> None:
    """Adjoint of contact i's rows, bias and compliance, then of its geometry."""
    contacts, rows, _, _ = work.problem
    velocity, finger_velocity = work.body[0].velocity, work.finger_velocity
    z, ends, w = back
    contact = contacts[i]
    f, gap = contact.finger, contact.gap
    give = finger_mobility(world) if f >= 0 else 0.0
    soft, slope = softness(gap, world.kappa, world.regularization), softness_slope(gap, world.kappa)
    ax, ay = contact.x - state.pose[0], contact.y - state.pose[1]
    nx_bar, ny_bar, ax_bar, ay_bar = 0.0, 0.0, 0.0, 0.0
    gap_bar = -w[2 * i] * bias_slope(gap, world.h, world.kappa)
    for part in range(2):
        row, m = rows[2 * i + part], w[2 * i + part]
        turn = row.P * z[2] - m * velocity[2] - 2 * m * row.P * soft * row.turn / world.inertia
        gap_bar -= m * row.P * slope * contact_scale(world, row.turn, give)
        ex = row.P * z[0] - m * velocity[0] - turn * ay
        ey = row.P * z[1] - m * velocity[1] + turn * ax
        if f >= 0:
            ex += m * finger_velocity[f, 0] - give * row.P * ends[f, 0]
            ey += m * finger_velocity[f, 1] - give * row.P * ends[f, 1]
        ax_bar += turn * row.y
        ay_bar -= turn * row.x
        # The tangent is the normal turned by 90 degrees.
        nx_bar += ex if part == 0 else ey
        ny_bar += ey if part == 0 else -ex
    bar.pose[0] -= ax_bar
    bar.pose[1] -= ay_bar
    _adjoint_geometry(contact, world, state, ContactBar(nx_bar, ny_bar, ax_bar, ay_bar, gap_bar), bar)


@borrowing
def _adjoint_geometry(contact: np.record, world: World, state: State, of: ContactBar, bar: State) -> None:
    """Adjoint of normal, contact point and gap with respect to the object's pose and the finger."""
    q, facet = state.pose, world.facets[contact.feature]
    rx, ry = vertex_arm(facet.x, facet.y, np.cos(q[2]), np.sin(q[2]))
    if contact.kind == WALL:
        _to_pose(of.x + of.gap * contact.nx, of.y + of.gap * contact.ny, rx, ry, bar.pose)
        return
    p, p_bar = state.fingers[contact.finger], bar.fingers[contact.finger]
    ox, oy = -contact.nx, -contact.ny
    sx, sy = p[0] - q[0] - rx, p[1] - q[1] - ry
    if contact.kind == FACET:
        distance = contact.gap + world.radius
        distance_bar = of.gap - of.x * ox - of.y * oy
        mx = distance_bar * sx - of.nx - distance * of.x
        my = distance_bar * sy - of.ny - distance * of.y
        p_bar[0] += of.x + distance_bar * ox
        p_bar[1] += of.y + distance_bar * oy
        _to_pose(-distance_bar * ox, -distance_bar * oy, rx, ry, bar.pose)
        bar.pose[2] += my * ox - mx * oy
        return
    sign, reach = 1 - 2 * facet.reflex, np.sqrt(sx * sx + sy * sy)
    ex, ey = sx / reach, sy / reach
    along = -of.nx * ex - of.ny * ey
    gx = sign * ((-of.nx - along * ex) / reach + of.gap * ex)
    gy = sign * ((-of.ny - along * ey) / reach + of.gap * ey)
    p_bar[0] += gx
    p_bar[1] += gy
    _to_pose(of.x - gx, of.y - gy, rx, ry, bar.pose)


@borrowing
def _to_pose(gx: float, gy: float, rx: float, ry: float, pose_bar: np.ndarray) -> None:
    """Adjoint of a body point at arm (rx, ry)."""
    pose_bar[0] += gx
    pose_bar[1] += gy
    pose_bar[2] += gy * rx - gx * ry
