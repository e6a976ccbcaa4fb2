"""The exact model in SCIP: rho is one number per contact interval, and torque enters as w = rho lambda_n (spatial branching).

Slow and independent of the other methods: it exists to cross-check them on small tasks.
"""

from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
import pyscipopt
from pyscipopt import quicksum

from expert.budget import Budget
from expert.contact.recovery import Found, balanced, modes_of, plan_of
from expert.contact.scaled import ScaledTask, end_points
from expert.errors import SolverFailed
from expert.geometry.pose import Array, cross
from expert.mip.backends import scip_answer, scip_limits
from expert.problems.contact import FREE, ContactTask, Plan, Status

TOLERANCE = 1e-7
"""Absolute feasibility tolerance asked of SCIP, in m g and m g L; its linear solver warns below."""


@dataclass(frozen=True)
class Bilinear:
    """SCIP's model and its variables: touch, rho, normal, tangential, w by (t, c, f); region by (t, c, r);
    p by (t, c, d); reaction by (t, e)."""

    scip: pyscipopt.Model
    touch: dict
    rho: dict
    normal: dict
    tangential: dict
    w: dict
    region: dict
    p: dict
    reaction: dict


def solve(task: ContactTask, *, gap: float, time_limit: float) -> Plan:
    """Globally optimal plan of the exact problem, to SCIP's tolerance.

    Raises SolverFailed where SCIP failed numerically, KeyboardInterrupt when interrupted.
    """
    budget = Budget(time_limit)
    s = ScaledTask.of(task)
    m = build(task, s)
    scip_limits(m.scip, gap, budget.left)
    m.scip.setParam("numerics/feastol", TOLERANCE)
    m.scip.optimize()
    answer = scip_answer(m.scip, [])
    if answer.status == "failed":
        raise SolverFailed(f"bilinear model: SCIP gave no answer ({answer.message})")
    spent: dict[str, Any] = {"bound": answer.bound * s.cost_unit, "nodes": answer.nodes}
    spent["seconds"] = budget.spent
    if answer.x is None:
        reason = "the exact bilinear model has no solution" if answer.status == "infeasible" else ""
        status: Status = "infeasible" if answer.status == "infeasible" else "time_limit"
        return Plan(status=status, reason=reason, **spent)
    status = "optimal" if answer.status == "optimal" else "feasible"
    return plan_of(
        task, s, balanced(s, _found(m, task, s), task.fingers.facet_margin), status=status, reason="", **spent
    )


def build(task: ContactTask, s: ScaledTask) -> Bilinear:
    """All constraints and the cost, one group after the other."""
    m = _variables(task, s)
    _contact(m, task, s)
    _sequence(m, task, s)
    _places(m, task, s)
    _dynamics(m, task, s)
    _cost(m, task, s)
    return m


def _indices(task: ContactTask, s: ScaledTask) -> tuple[range, range, range, range]:
    return range(s.steps), range(task.fingers.count), range(s.facets), range(s.regions)


def _variables(task: ContactTask, s: ScaledTask) -> Bilinear:
    scip = pyscipopt.Model()
    scip.hideOutput()
    steps, fingers, facets, regions = _indices(task, s)
    friction = s.friction
    low, high = s.workspace

    def grid(name: str, *axes: range, **options: Any) -> dict:
        return {i: scip.addVar(name=f"{name}{list(i)}", **options) for i in product(*axes)}

    touching = (steps, fingers, facets)
    return Bilinear(
        scip=scip,
        touch=grid("touch", *touching, vtype="B"),
        rho=grid("rho", *touching, lb=0.0, ub=1.0),
        normal=grid("normal", *touching, lb=0.0, ub=s.max_force),
        tangential=grid("tangential", *touching, lb=-friction * s.max_force, ub=friction * s.max_force),
        w=grid("w", *touching, lb=0.0, ub=s.max_force),
        region=grid("region", steps, fingers, regions, vtype="B"),
        p={(t, c, d): scip.addVar(lb=low[d], ub=high[d]) for t, c, d in product(steps, fingers, range(2))},
        reaction={
            (t, e): scip.addVar(lb=0.0, ub=s.limit[t, s.group[t, e]]) for t, e in np.argwhere(s.group >= 0)
        },
    )


def _contact(m: Bilinear, task: ContactTask, s: ScaledTask) -> None:
    """Force within its cone while the finger stays; w = rho lambda_n; rho within the margins."""
    add, margin = m.scip.addCons, task.fingers.facet_margin
    friction = s.friction
    last = s.steps - 1
    for (t, c, f), touch in m.touch.items():
        normal, tangential, rho = m.normal[t, c, f], m.tangential[t, c, f], m.rho[t, c, f]
        stays = [touch] if t == last else [touch, m.touch[t + 1, c, f]]
        for one in stays:
            add(normal <= s.max_force * one)
        if s.min_force:
            add(normal >= s.min_force * (quicksum(stays) - len(stays) + 1))
        add(tangential <= friction * normal)
        add(tangential >= -friction * normal)
        add(rho >= margin)
        add(rho <= 1 - margin)
        add(m.w[t, c, f] == rho * normal)


def _sequence(m: Bilinear, task: ContactTask, s: ScaledTask) -> None:
    """One facet or one region; free before another facet; one rho per contact interval; contacts that last."""
    add = m.scip.addCons
    steps, fingers, facets, regions = _indices(task, s)
    for t, c in product(steps, fingers):
        add(quicksum(m.touch[t, c, f] for f in facets) + quicksum(m.region[t, c, r] for r in regions) == 1)
    for t, c, f in product(steps[:-1], fingers, facets):
        now, later = m.touch[t, c, f], m.touch[t + 1, c, f]
        for g in facets:
            if g != f:
                add(now + m.touch[t + 1, c, g] <= 1)
        difference = m.rho[t + 1, c, f] - m.rho[t, c, f]
        add(difference <= 2 - now - later)
        add(difference >= now + later - 2)
    if task.robustness.min_interval == 2:
        for (t, c, f), touch in m.touch.items():
            add(touch <= quicksum(m.touch[u, c, f] for u in (t - 1, t + 1) if u in steps))


def _places(m: Bilinear, task: ContactTask, s: ScaledTask) -> None:
    """Fingers on their facets, or in their regions; all of them clear of walls.  Big-M from the workspace box."""
    add = m.scip.addCons
    low, high = s.workspace
    margin = task.fingers.facet_margin
    for (t, c, f), touch in m.touch.items():
        (ax, ay), (bx, by) = end_points(s)[t, f] + s.centre[t]
        for d, (a, b) in enumerate(((ax, bx), (ay, by))):
            ends = (a + margin * (b - a), b - margin * (b - a))
            offset = m.p[t, c, d] - a - m.rho[t, c, f] * (b - a)
            add(offset <= (high[d] - min(ends)) * (1 - touch))
            add(offset >= (low[d] - max(ends)) * (1 - touch))
    for (t, c, r), inside in m.region.items():
        for x, y, b in s.region[t, r]:
            farthest = max(x * low[0], x * high[0]) + max(y * low[1], y * high[1])
            if x or y:
                add(x * m.p[t, c, 0] + y * m.p[t, c, 1] <= b + max(farthest - b, 0.0) * (1 - inside))
    for t, c in product(*_indices(task, s)[:2]):
        for x, y, d in s.walls:
            add(x * m.p[t, c, 0] + y * m.p[t, c, 1] >= d)


def _dynamics(m: Bilinear, task: ContactTask, s: ScaledTask) -> None:
    """Newton and Euler at every step: force lambda_n n + lambda_t tau, torque (a - q) x lambda + l w."""
    steps, fingers, facets, _ = _indices(task, s)
    rays = [(int(t), int(e)) for t, e in m.reaction]
    for t in steps:
        for row in range(3):
            terms = [s.rays[t, e, row] * m.reaction[u, e] for u, e in rays if u == t and s.rays[t, e, row]]
            for c, f in product(fingers, facets):
                along = (s.normal[t, f], s.tangent[t, f])
                gain_n, gain_t = (_wrench(s.arm[t, f], direction)[row] for direction in along)
                terms += [gain_n * m.normal[t, c, f], gain_t * m.tangential[t, c, f]]
                terms += [s.length[f] * m.w[t, c, f]] if row == 2 else []
            m.scip.addCons(quicksum(terms) == s.required[t, row])
    for t, g in sorted({(int(t), int(s.group[t, e])) for t, e in rays}):
        group = [m.reaction[u, e] for u, e in rays if u == t and s.group[t, e] == g]
        m.scip.addCons(quicksum(group) <= s.limit[t, g])


def _wrench(arm: Array, force: Array) -> Array:
    return np.array([*force, float(cross(arm, force))])


def _cost(m: Bilinear, task: ContactTask, s: ScaledTask) -> None:
    """sum |lambda|^2 + |p_ddot|^2 - beta, one epigraph variable per square."""
    terms: list[Any] = []

    def charge(weight: float, expression: Any) -> None:
        square = m.scip.addVar(lb=0.0)
        m.scip.addCons(weight * expression * expression <= square)
        terms.append(square)

    if s.force_weight:
        for component in (*m.normal.values(), *m.tangential.values()):
            charge(s.force_weight, component)
    if s.acceleration_weight:
        for t, c, d in m.p:
            if t >= 2:
                charge(s.acceleration_weight, m.p[t, c, d] - 2 * m.p[t - 1, c, d] + m.p[t - 2, c, d])
    if s.margin_weight:
        mu = s.true_friction
        for i in m.normal:
            beta = m.scip.addVar(lb=0.0)
            for side in (1, -1):
                m.scip.addCons(beta <= mu * m.normal[i] + side * m.tangential[i])
            terms.append(-s.margin_weight * beta)
    m.scip.setObjective(quicksum(terms))


def _found(m: Bilinear, task: ContactTask, s: ScaledTask) -> Found:
    """Values of the best point; cone weights alpha from the force's components."""
    best: Any = m.scip.getBestSol()
    shape = (s.steps, task.fingers.count)

    def values(grid: dict, last: int) -> Array:
        return np.array([best[v] for v in grid.values()]).reshape(*shape, last)

    facets = s.facets
    modes = modes_of(values(m.touch, facets))
    facet = np.maximum(modes, 0)[..., None]
    rho, normal, tangential = (
        np.take_along_axis(values(grid, facets), facet, axis=2)[..., 0]
        for grid in (m.rho, m.normal, m.tangential)
    )
    alpha = np.stack([normal + tangential / s.friction, normal - tangential / s.friction], axis=2) / 2
    reactions = np.zeros(s.group.shape)
    for i, v in m.reaction.items():
        reactions[i] = best[v]
    return Found(
        modes=modes,
        rho=np.where(modes == FREE, 0.0, rho),
        alpha=alpha,
        free=values(m.p, 2),
        reactions=reactions,
    )
