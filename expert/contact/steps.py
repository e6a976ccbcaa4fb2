"""One time step: least force cost with given facets active, exact wrench cones, and bounds that duality makes safe.

A finger on a facet with rho in [lo, hi] exerts every wrench of the cone spanned by its friction rays at both ends, and
no other: with w = rho lambda_n the cone is convex (the products of 3-CT2 without the envelopes of 3-CT8 and 3-CT9).  For any
multipliers y of the wrench balance, D(y) = y.required - max_environment - sum_c max_finger is a lower bound of the step's
cost, evaluated in closed form; the tolerance of the program's solver therefore never enters a bound.
"""

from typing import NamedTuple

import numpy as np

from expert.contact.imbalance import nearly_balanced
from expert.contact.scaled import ScaledTask
from expert.geometry.pose import Array
from expert.numeric.qp import FAILED, INFEASIBLE, SOLVED, compiled, solve_qp
from expert.world.values import IntArray

RIDGE = 1e-9
"""Curvature given to reactions and to doubly described forces, in units of 1 / (m g)^2: reactions cost nothing."""
CERTAIN = 1e-9
"""An infeasible step must miss its required wrench by this much [m g, m g L] for multipliers of length one."""


class Stance(NamedTuple):
    """Facets (n,) that are pushed at step t, and the ranges lo <= rho <= hi of the fingers' places, (n,) each."""

    t: int
    facets: IntArray
    lo: Array
    hi: Array


class Balance(NamedTuple):
    """status, cost reached, certified lower bound, multipliers y (3,) of the wrench balance, ray weights x.

    status INFEASIBLE only where y proves it, which `shortfall` confirms; SOLVED up to an imbalance of CERTAIN; FAILED leaves a bound.
    """

    status: int
    cost: float
    bound: float
    y: Array
    x: Array


@compiled
def seen(scaled: ScaledTask, t: int, f: int, rho: float, y: Array) -> tuple[float, float]:
    """Multipliers y as normal and tangential gain of a force at rho: y.wrench = z_n lambda_n + z_t lambda_t."""
    dx = scaled.arm[t, f, 0] + rho * scaled.edge[t, f, 0]
    dy = scaled.arm[t, f, 1] + rho * scaled.edge[t, f, 1]
    zx, zy = y[0] - y[2] * dy, y[1] + y[2] * dx
    n, tau = scaled.normal[t, f], scaled.tangent[t, f]
    return zx * n[0] + zy * n[1], zx * tau[0] + zy * tau[1]


@compiled
def gain(scaled: ScaledTask, t: int, f: int, rho: float, y: Array) -> float:
    """h(rho) = max over the friction cone of y.wrench - |lambda|^2 + margin term (beta).  Convex in rho."""
    zn, zt = seen(scaled, t, f, rho, y)
    mu, weight = scaled.friction, scaled.force_weight
    zn, zt = zn + scaled.margin_weight * scaled.true_friction, max(abs(zt) - scaled.margin_weight, 0.0)
    edge = (zn + mu * zt) / max(2 * weight * (1 + mu * mu), 1e-300)
    normal = zn / max(2 * weight, 1e-300) if mu * mu * zn >= zt * mu else edge
    normal = min(max(normal, scaled.min_force), scaled.max_force)
    tangential = min(zt / max(2 * weight, 1e-300), mu * normal)
    return zn * normal + zt * tangential - weight * (normal * normal + tangential * tangential)


@compiled
def reach(scaled: ScaledTask, t: int, f: int, rho: float, y: Array) -> float:
    """max over the friction cone of y.wrench.  Convex in rho."""
    zn, zt = seen(scaled, t, f, rho, y)
    most = zn + scaled.friction * abs(zt)
    return most * (scaled.max_force if most > 0 else scaled.min_force)


@compiled
def environment_reach(scaled: ScaledTask, t: int, y: Array) -> float:
    """max over what walls and support can exert of y.wrench (3-CT6)."""
    total, group, best = 0.0, -1, 0.0
    for e in range(scaled.rays.shape[1]):
        g = scaled.group[t, e]
        if g != group:
            if group >= 0:
                total += best * scaled.limit[t, group]
            group, best = g, 0.0
        if g < 0:
            break
        ray = scaled.rays[t, e]
        best = max(best, ray[0] * y[0] + ray[1] * y[1] + ray[2] * y[2])
    if group >= 0:
        total += best * scaled.limit[t, group]
    return total


@compiled
def cost_bound(scaled: ScaledTask, stance: Stance, y: Array) -> float:
    """D(y): no wrench balance of this stance costs less."""
    t, facets, lo, hi = stance
    bound = scaled.required[t] @ y - environment_reach(scaled, t, y)
    for i in range(facets.size):
        bound -= max(gain(scaled, t, facets[i], lo[i], y), gain(scaled, t, facets[i], hi[i], y))
    return bound


@compiled
def shortfall(scaled: ScaledTask, stance: Stance, y: Array) -> float:
    """Positive: no wrench balance of this stance exists, and y proves it."""
    t, facets, lo, hi = stance
    miss = scaled.required[t] @ y - environment_reach(scaled, t, y)
    for i in range(facets.size):
        miss -= max(reach(scaled, t, facets[i], lo[i], y), reach(scaled, t, facets[i], hi[i], y))
    return miss


class StepProgram(NamedTuple):
    """min x'Hx/2 + g'x over ray weights x: A x = b in the first three rows, the wrench balance; A x >= b in the others,
    which are x >= 0, then the limits of each finger's normal force, then those of each group of reactions.

    Rays: those of each finger at lo, and at hi where that differs; then the environment's.
    """

    H: Array
    g: Array
    A: Array
    b: Array


@compiled
def rays_per_end(scaled: ScaledTask) -> int:
    """Rays of a finger at one rho: both edges of its cone, and the normal where the margin is rewarded."""
    return 3 if scaled.margin_weight > 0 else 2


@compiled
def step_program(scaled: ScaledTask, stance: Stance) -> StepProgram:
    """Least cost of forces that balance a step with every rho in its range (3-CT1 to 3-CT4, 3-CT6)."""
    t, facets, lo, hi = stance
    each, count = rays_per_end(scaled), 0
    for i in range(facets.size):
        count += each if lo[i] == hi[i] else 2 * each
    reactions, groups = environment_size(scaled, t)
    n = count + reactions
    rows = 3 + n + facets.size * (2 if scaled.min_force > 0 else 1) + groups
    H, A, b = np.zeros((n, n)), np.zeros((rows, n)), np.zeros(rows)
    program = StepProgram(H, np.zeros(n), A, b)
    b[:3] = scaled.required[t]
    k, row = 0, 3 + n
    for i in range(facets.size):
        first, k = k, add_rays(scaled, program, t, facets[i], lo[i], k)
        if hi[i] != lo[i]:
            k = add_rays(scaled, program, t, facets[i], hi[i], k)
        row = add_finger(scaled, program, first, k, row)
    add_environment(scaled, program, t, count, row)
    for k in range(n):
        H[k, k] += RIDGE
        A[3 + k, k] = 1.0
    return program


@compiled
def environment_size(scaled: ScaledTask, t: int) -> tuple[int, int]:
    """Rays and groups of the environment at step t."""
    rays, groups = 0, 0
    while rays < scaled.rays.shape[1] and scaled.group[t, rays] >= 0:
        groups = scaled.group[t, rays] + 1
        rays += 1
    return rays, groups


@compiled
def add_rays(scaled: ScaledTask, program: StepProgram, t: int, f: int, rho: float, k: int) -> int:
    """Columns of a finger's rays at rho, from column k on; returns the next column."""
    _, g, A, _ = program
    normal, tangent = scaled.normal[t, f], scaled.tangent[t, f]
    dx = scaled.arm[t, f, 0] + rho * scaled.edge[t, f, 0]
    dy = scaled.arm[t, f, 1] + rho * scaled.edge[t, f, 1]
    for j in range(rays_per_end(scaled)):
        slope = (scaled.friction, -scaled.friction, 0.0)[j]
        fx, fy = normal[0] + slope * tangent[0], normal[1] + slope * tangent[1]
        A[0, k], A[1, k], A[2, k] = fx, fy, dx * fy - dy * fx
        g[k] = -scaled.margin_weight * (scaled.true_friction - abs(slope))
        k += 1
    return k


@compiled
def add_finger(scaled: ScaledTask, program: StepProgram, first: int, last: int, row: int) -> int:
    """|lambda|^2 of the finger with columns first to last, and the limits of its normal force; returns the next row.

    Where the margin is rewarded, (lambda_t^2 + s^2) / 2 stands for lambda_t^2, with s the sum of the tangential parts of all rays
    without their signs: it is |lambda_t| at the optimum, since less of it earns more.  Without that, weights of the
    three rays could run off along a direction with a slope and no curvature.
    """
    H, _, A, b = program
    rewarded = scaled.margin_weight > 0
    for p in range(first, last):
        for q in range(first, last):
            square = A[0, p] * A[0, q] + A[1, p] * A[1, q]
            if rewarded:
                across = square - 1.0  # rays have unit normal component
                square = 1.0 + max(across, 0.0)
            H[p, q] = 2 * scaled.force_weight * square
    A[row, first:last], b[row] = -1.0, -scaled.max_force
    if scaled.min_force <= 0:
        return row + 1
    A[row + 1, first:last], b[row + 1] = 1.0, scaled.min_force
    return row + 2


@compiled
def add_environment(scaled: ScaledTask, program: StepProgram, t: int, first: int, row: int) -> None:
    """Columns of the environment's rays from `first` on, and the limits of its groups in the rows from `row` on."""
    _, g, A, b = program
    for e in range(g.size - first):
        group = scaled.group[t, e]
        for d in range(3):
            A[d, first + e] = scaled.rays[t, e, d]
        A[row + group, first + e] = -1.0
        b[row + group] = -scaled.limit[t, group]


@compiled
def program_cost(H: Array, g: Array, x: Array) -> float:
    """x'Hx/2 + g'x without the ridge."""
    total = 0.0
    for i in range(g.size):
        row = -RIDGE * x[i]
        for j in range(g.size):
            row += H[i, j] * x[j]
        total += x[i] * (g[i] + 0.5 * row)
    return total


@compiled
def solve_step(scaled: ScaledTask, stance: Stance) -> Balance:
    """The least-cost balance of a stance, or a proof that it has none."""
    H, g, A, b = step_program(scaled, stance)
    y = np.zeros(3)
    if g.size == 0:
        size = np.abs(b[:3]).max()
        if size <= CERTAIN:
            return Balance(SOLVED, 0.0, 0.0, y, g)
        y[:] = b[:3] / size
        return Balance(INFEASIBLE, np.inf, np.inf, y, g)
    status, x, u = solve_qp(H, g, A, b, np.int64(3), scaled.iterations)
    y[:] = u[:3]
    if status == INFEASIBLE and proves(scaled, stance, y):
        return Balance(INFEASIBLE, np.inf, np.inf, y, x)
    if status != SOLVED:
        success, x, y, missing = nearly_balanced(H, g, A, b, scaled.iterations)
        status = SOLVED if success and np.sqrt(missing @ missing) <= CERTAIN else FAILED
        if status == FAILED and success and proves(scaled, stance, missing):
            return Balance(INFEASIBLE, np.inf, np.inf, missing, x)
    cost, bound = program_cost(H, g, x) if status == SOLVED else np.inf, cost_bound(scaled, stance, y)
    if status != SOLVED or cost - bound > CERTAIN * (1 + abs(cost)):
        trivial = cost_bound(scaled, stance, np.zeros(3))
        if trivial > bound:
            bound, y[:] = trivial, 0.0
    return Balance(status, cost, bound, y, x)


@compiled
def proves(scaled: ScaledTask, stance: Stance, y: Array) -> bool:
    """Scale multipliers to length one; whether they prove that there is no balance."""
    length = float(np.sqrt(y @ y))
    if length > 0.0:
        y /= length
    return length > 0.0 and shortfall(scaled, stance, y) > CERTAIN
