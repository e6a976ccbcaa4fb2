"""MIQP1 of the thesis (3.1.3), errata mended: a relaxation whose torques lie in McCormick envelopes.

Its bound and its proofs of infeasibility hold for the exact problem; its plans satisfy Newton-Euler only up to the
envelope error, which each plan states as its residual.
"""

import cvxpy as cp
import numpy as np

from expert.budget import Budget
from expert.contact.recovery import Found, modes_of, plan_of
from expert.contact.scaled import ScaledTask
from expert.contact.thesis_blocks import (
    Variables,
    alternated_sticking,
    angular_dynamics,
    complementarity,
    cone_distance,
    contact_assignment,
    environment_cones,
    linear_dynamics,
    non_penetration,
    torque_cells,
    torque_envelopes,
)
from expert.errors import SolverFailed
from expert.mip.backends import Solver
from expert.mip.block import Block
from expert.mip.solve import Result
from expert.mip.solve import solve as solve_program
from expert.problems.contact import FREE, ContactTask, Plan, Status

PLAN_STATUS: dict[str, Status] = {
    "optimal": "optimal",
    "feasible": "feasible",
    "infeasible": "infeasible",
    "limit": "time_limit",
}


def solve(
    task: ContactTask,
    *,
    gap: float,
    time_limit: float,
    segments: int = 4,
    solver: Solver = "scip",
) -> Plan:
    """Minimise over MIQP1 with `segments` McCormick segments per bilinear term; the plan's residual is the envelope error.

    Raises SolverFailed where the solver failed numerically: nothing is known then.
    """
    budget = Budget(time_limit)
    s = ScaledTask.of(task)
    x = Variables.of(s, task.fingers.count, segments)
    program = cp.Problem(
        cp.Minimize(cost(x, s)), [c for b in blocks(x, s, task, segments) for c in b.constraints]
    )
    result = solve_program(program, solver=solver, gap=gap, time_limit=budget.left)
    return _plan(task, s, x, result, segments, budget.spent)


def cost(x: Variables, s: ScaledTask) -> cp.Expression:
    """J = sum |lam|^2 + |p_ddot|^2 - beta (Thesis 3.1.4), in (m g)^2; p_ddot by backward differences, t >= 3."""
    objective = s.force_weight * cp.sum_squares(cp.vec(x.lam, order="F"))
    if s.steps > 2:
        p_ddot = x.p[2:] - 2 * x.p[1:-1] + x.p[:-2]
        objective += s.acceleration_weight * cp.sum_squares(cp.vec(p_ddot, order="F"))
    if not s.margin_weight:
        return objective
    return objective - s.margin_weight * np.hypot(1, s.true_friction) * cp.sum(x.beta)


def blocks(x: Variables, s: ScaledTask, task: ContactTask, segments: int) -> list[Block]:
    """The "subject to" list of MIQP1 (Thesis 3-MIQP1)."""
    mu = task.fingers.friction
    program = [
        linear_dynamics(x, s),  # 3-CT1
        angular_dynamics(x, s),  # 3-CT2
        contact_assignment(x, s, task.fingers.facet_margin),  # 3-CT3
        complementarity(x, s),  # 3-CT4
        alternated_sticking(x, s, task.robustness.min_interval),  # 3-CT5
        environment_cones(x, s),  # 3-CT6
        non_penetration(x, s),  # 3-CT7
        torque_envelopes(x, s, segments),  # 3-CT8, 3-CT9
    ]
    return (
        [*program, cone_distance(x, mu, task.robustness.cone_fraction * mu)] if s.margin_weight else program
    )


def _plan(
    task: ContactTask, s: ScaledTask, x: Variables, result: Result, segments: int, seconds: float
) -> Plan:
    if result.status == "failed":
        raise SolverFailed(
            f"MIQP1: the solver gave no answer ({result.message}); try another solver or fewer segments"
        )
    status = PLAN_STATUS[result.status]
    if not result.found:
        reason = "MIQP1, a relaxation of the exact problem, has no solution" if status == "infeasible" else ""
        return Plan(
            status=status,
            seconds=seconds,
            nodes=result.nodes,
            bound=result.bound * s.cost_unit,
            reason=reason,
        )
    error = 2 * task.fingers.count * torque_cells(s, segments).largest_error
    return plan_of(
        task,
        s,
        point_of(x),
        status=status,
        bound=result.bound * s.cost_unit,
        seconds=seconds,
        nodes=result.nodes,
        reason=f"torques in McCormick envelopes with {segments} segments: off by up to {error:.2g} m g L",
    )


def point_of(x: Variables) -> Found:
    """What the variables hold, facet by facet."""
    p, rho, alpha, reactions, T = (np.asarray(v.value) for v in (x.p, x.rho, x.alpha, x.alpha_e, x.T))
    modes = modes_of(T)
    facet = np.maximum(modes, 0)[..., None, None]
    rho, alpha = (np.take_along_axis(weights, facet, axis=2)[:, :, 0] for weights in (rho, alpha))
    return Found(
        modes=modes, rho=np.where(modes == FREE, 0.0, rho[..., 1]), alpha=alpha, free=p, reactions=reactions
    )
