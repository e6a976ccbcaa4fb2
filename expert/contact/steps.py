"""One time step: least force cost with given facets active, exact wrench cones, and bounds that duality makes safe.

A finger on a facet with rho in [lo, hi] exerts every wrench of the cone spanned by its friction rays at both ends, and
no other: with w = rho lambda_n the cone is convex (Thesis 3-CT2 to 3-CT4 without an envelope).  For any multipliers y of
the wrench balance, D(y) = y.required - max_environment - sum_c max_finger is a lower bound of the step's cost, evaluated
in closed form; the tolerance of the program's solver therefore never enters a bound.  All quantities are without
dimension, see `scaled`.
"""

import numpy as np

from expert.contact.scaled import ScaledTask
from expert.geometry.pose import Array
from expert.numeric.qp import FAILED, INFEASIBLE, SOLVED, compiled, solve_qp
from expert.world.values import IntArray

RIDGE = 1e-9
"""Curvature given to reactions and to doubly described forces, in units of 1 / (m g)^2: reactions cost nothing."""
CERTIFICATES, BISECTIONS = 4, 10
"""Steps by either means towards the end of a range of rho."""
CERTAIN = 1e-9
"""An infeasible step must miss its required wrench by this much [m g, m g L] for multipliers of length one."""


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
    """h(rho) = max over the friction cone of y.wrench - |lambda|^2 + margin term.  Convex in rho."""
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
    """max over what walls and support can exert of y.wrench."""
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
def cost_bound(scaled: ScaledTask, t: int, facets: IntArray, lo: Array, hi: Array, y: Array) -> float:
    """D(y): no wrench balance with these facets costs less."""
    bound = scaled.required[t] @ y - environment_reach(scaled, t, y)
    for i in range(facets.size):
        low, high = gain(scaled, t, facets[i], lo[i], y), gain(scaled, t, facets[i], hi[i], y)
        bound -= max(low, high)
    return bound


@compiled
def shortfall(scaled: ScaledTask, t: int, facets: IntArray, lo: Array, hi: Array, y: Array) -> float:
    """Positive: no wrench balance exists with these facets, and y proves it."""
    miss = scaled.required[t] @ y - environment_reach(scaled, t, y)
    for i in range(facets.size):
        miss -= max(reach(scaled, t, facets[i], lo[i], y), reach(scaled, t, facets[i], hi[i], y))
    return miss


@compiled
def rays_per_end(scaled: ScaledTask) -> int:
    """Rays of a finger at one rho: both edges of its cone, and the normal where the margin is rewarded."""
    return 3 if scaled.margin_weight > 0 else 2


@compiled
def step_program(
    scaled: ScaledTask, t: int, facets: IntArray, lo: Array, hi: Array
) -> tuple[Array, Array, Array, Array]:
    """H, g, A, b of the step's program over ray weights x >= 0: the wrench balance, x >= 0, limits of force.

    Rays: those of each finger at lo, and at hi where that differs; then the environment's.
    """
    each = rays_per_end(scaled)
    count = 0
    for i in range(facets.size):
        count += each if lo[i] == hi[i] else 2 * each
    env, groups = 0, 0
    while env < scaled.rays.shape[1] and scaled.group[t, env] >= 0:
        groups = scaled.group[t, env] + 1
        env += 1
    n = count + env
    limits = facets.size * (2 if scaled.min_force > 0 else 1)
    m = 3 + n + limits + groups
    H, g, A, b = np.zeros((n, n)), np.zeros(n), np.zeros((m, n)), np.zeros(m)
    force = np.zeros((2, n))
    k, row = 0, 3 + n
    for i in range(facets.size):
        f, first = facets[i], k
        normal, tangent = scaled.normal[t, f], scaled.tangent[t, f]
        for end in range(1 if lo[i] == hi[i] else 2):
            rho = lo[i] if end == 0 else hi[i]
            dx = scaled.arm[t, f, 0] + rho * scaled.edge[t, f, 0]
            dy = scaled.arm[t, f, 1] + rho * scaled.edge[t, f, 1]
            for j in range(each):
                slope = (scaled.friction, -scaled.friction, 0.0)[j]
                fx, fy = normal[0] + slope * tangent[0], normal[1] + slope * tangent[1]
                force[0, k], force[1, k] = fx, fy
                A[0, k], A[1, k], A[2, k] = fx, fy, dx * fy - dy * fx
                g[k] = -scaled.margin_weight * (scaled.true_friction - abs(slope))
                k += 1
        for p in range(first, k):
            for q in range(first, k):
                H[p, q] = 2 * scaled.force_weight * (force[0, p] * force[0, q] + force[1, p] * force[1, q])
        A[row, first:k], b[row] = -1.0, -scaled.max_force
        row += 1
        if scaled.min_force > 0:
            A[row, first:k], b[row] = 1.0, scaled.min_force
            row += 1
    for e in range(env):
        for d in range(3):
            A[d, count + e] = scaled.rays[t, e, d]
        A[row + scaled.group[t, e], count + e] = -1.0
    for p in range(groups):
        b[row + p] = -scaled.limit[t, p]
    for k in range(n):
        H[k, k] += RIDGE
        A[3 + k, k] = 1.0
    b[:3] = scaled.required[t]
    return H, g, A, b


@compiled
def solve_step(
    scaled: ScaledTask, t: int, facets: IntArray, lo: Array, hi: Array
) -> tuple[int, float, float, Array, Array]:
    """Status, cost reached, lower bound, multipliers y (a proof where infeasible), ray weights x.

    INFEASIBLE only with a proof that `shortfall` confirms; FAILED leaves the bound of y = 0 and no more.
    """
    H, g, A, b = step_program(scaled, t, facets, lo, hi)
    y = np.zeros(3)
    if g.size == 0:
        size = np.abs(scaled.required[t]).max()
        if size <= CERTAIN:
            return SOLVED, 0.0, 0.0, y, g
        y[:] = scaled.required[t] / size
        return INFEASIBLE, np.inf, np.inf, y, g
    status, x, u = solve_qp(H, g, A, b, np.int64(3), scaled.iterations)
    y[:] = u[:3]
    if status == SOLVED:
        cost = float(0.5 * x @ (H @ x) - 0.5 * RIDGE * (x @ x) + g @ x)
        trivial = cost_bound(scaled, t, facets, lo, hi, np.zeros(3))
        return SOLVED, cost, max(trivial, cost_bound(scaled, t, facets, lo, hi, y)), y, x
    if status == INFEASIBLE:
        length = np.sqrt(y @ y)
        if length > 0:
            y /= length
            if shortfall(scaled, t, facets, lo, hi, y) > CERTAIN:
                return INFEASIBLE, np.inf, np.inf, y, x
    y[:] = 0.0
    return FAILED, np.inf, cost_bound(scaled, t, facets, lo, hi, y), y, x


@compiled
def tighten(scaled: ScaledTask, t: int, facets: IntArray, lo: Array, hi: Array, i: int, end: int) -> bool:
    """Move lo[i] (end 0) or hi[i] (end 1) in towards the first rho that admits a wrench balance.  False: there is none.

    First by certificates: multipliers that prove one rho hopeless rule out its neighbours too.  Then by bisection: the
    rho of a convex set of (w, lambda_n) form an interval, so what lies beyond a hopeless rho is hopeless.
    """
    low, high = lo.copy(), hi.copy()
    f = facets[i]
    far = hi[i] if end == 0 else lo[i]
    near = lo[i] if end == 0 else hi[i]
    for _ in range(CERTIFICATES):
        low[i] = high[i] = near
        status, _, _, y, _ = solve_step(scaled, t, facets, low, high)
        if status != INFEASIBLE:
            return True
        others = shortfall(scaled, t, facets, low, high, y) + reach(scaled, t, f, near, y) - CERTAIN
        if reach(scaled, t, f, far, y) < others:
            return False  # convex in rho: no rho in between reaches it either
        near = first_reach(scaled, t, f, near, far, y, others)
        if end == 0:
            lo[i] = near
        else:
            hi[i] = near
    possible = balanced_rho(scaled, t, facets, lo, hi, i)
    if possible < 0 or possible == np.inf:
        return possible < 0
    for _ in range(BISECTIONS):
        low[i] = high[i] = 0.5 * (near + possible)
        if solve_step(scaled, t, facets, low, high)[0] == INFEASIBLE:
            near = low[i]
        else:
            possible = low[i]
    if end == 0:
        lo[i] = near
    else:
        hi[i] = near
    return True


@compiled
def balanced_rho(scaled: ScaledTask, t: int, facets: IntArray, lo: Array, hi: Array, i: int) -> float:
    """The rho of finger i in the least-cost balance over the box; -1: unknown, or any rho will do; inf: none exists."""
    status, _, _, _, x = solve_step(scaled, t, facets, lo, hi)
    if status != SOLVED:
        return np.inf if status == INFEASIBLE else -1.0
    each, k = rays_per_end(scaled), 0
    for j in range(i):
        k += each if lo[j] == hi[j] else 2 * each
    at_low, at_high = x[k : k + each].sum(), x[k + each : k + 2 * each].sum()
    if lo[i] == hi[i] or at_low + at_high <= 0:
        return -1.0
    return (at_low * lo[i] + at_high * hi[i]) / (at_low + at_high)


@compiled
def first_reach(scaled: ScaledTask, t: int, f: int, rho: float, far: float, y: Array, wanted: float) -> float:
    """Where `reach`, convex with reach(rho) < wanted <= reach(far), attains `wanted`; never beyond that point."""
    short, long = rho, far
    for _ in range(60):
        middle = 0.5 * (short + long)
        if reach(scaled, t, f, middle, y) < wanted:
            short = middle  # convex: nothing between rho and here reaches it
        else:
            long = middle
    return short
