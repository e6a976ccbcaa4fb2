"""The exact solver: contact positions and forces that make a motion, with a certified gap, or a proof that none do.

No envelope: with w = rho lambda_n the wrench cone of a facet is convex (see `steps`), so what remains non-convex is one rho
per contact interval, and a best-first search branches on modes, on rho and on free regions (see `search`).
"""

import time
from functools import cache

import numpy as np

from expert.contact.model import Model, model_of
from expert.contact.plan_at import all_forces, positions_at
from expert.contact.polish import mend
from expert.contact.polish import polish as polished
from expert.contact.reasons import why_infeasible
from expert.contact.recovery import plan_cost, wrench_residual
from expert.contact.search import NEGLIGIBLE, Outcome, Search
from expert.contact.sequence import sequence_of
from expert.errors import SolverFailed
from expert.geometry.pose import Array
from expert.problems.contact import ContactTask, Plan, Status
from expert.world.environment import Environment
from expert.world.fingers import Fingers
from expert.world.motion import Trajectory
from expert.world.shape import Body
from expert.world.walls import HalfPlane

RESIDUAL = 1e-8
"""Largest Newton-Euler residual of a plan that is handed out, over m g and m g L."""


def solve(
    task: ContactTask,
    *,
    gap: float = 1e-3,
    time_limit: float = 60.0,
    node_limit: int | None = None,
    polish: bool = True,
) -> Plan:
    """Globally optimal plan (Thesis 3.1) to a relative `gap`; budgets in seconds and in nodes, the latter repeatable.

    polish: finish at a stationary point of the cost at the best modes.  Raises SolverFailed where numerical failures
    leave the task undecided.
    """
    warm_up()
    start = time.perf_counter()
    model = model_of(task)
    search = Search(model, task.fingers.count, gap)
    outcome = search.run(node_limit=node_limit, deadline=start + time_limit)
    scale = task.weight**2
    if outcome.best.sequence is None:
        status, reason = _without_plan(task, model, search, outcome)
        bound = np.inf if status == "infeasible" else outcome.bound * scale
        return Plan(
            status=status,
            bound=bound,
            seconds=time.perf_counter() - start,
            nodes=outcome.nodes,
            reason=reason,
        )
    z = outcome.best.z
    if polish:
        z = polished(model, outcome.best.sequence, z).z
    return _plan(task, model, outcome, z, gap, start)


@cache
def warm_up() -> None:
    """Compile or load the numerical code, once a process, so that time limits and times count solving alone."""
    body, _ = Body.uniform([[0, 0], [1, 0], [0, 1]], 1.0)
    task = ContactTask(
        body=body,
        environment=Environment(walls=(HalfPlane(point=np.zeros(2), normal=np.array([0.0, 1.0])),)),
        trajectory=Trajectory.of([[0, 1, 0], [0, 1.1, 0], [0, 1.2, 0]], 1.0),
        fingers=Fingers(count=1, friction=0.5, max_force=100.0),
    )
    model = model_of(task)
    best = Search(model, 1, 0.1).run(node_limit=None, deadline=np.inf).best
    if best.sequence is not None:
        polished(model, best.sequence, best.z)
    mend(model, sequence_of(model, np.zeros((3, 1), dtype=np.int64)), np.array([0.5]))


def _without_plan(task: ContactTask, model: Model, search: Search, outcome: Outcome) -> tuple[Status, str]:
    if outcome.limited:
        return "time_limit", "the budget was spent before a plan was found"
    if np.isfinite(outcome.bound):
        raise SolverFailed("some contact sequences could neither be solved nor ruled out numerically")
    return "infeasible", why_infeasible(task, model, search.phi)


def _plan(task: ContactTask, model: Model, outcome: Outcome, z: Array, gap: float, start: float) -> Plan:
    sequence = outcome.best.sequence
    if sequence is None:
        raise SolverFailed("no contact sequence to recover a plan from")
    positions = positions_at(task, model, sequence, z)
    forces, reactions = all_forces(task, model, sequence, z)
    residual = wrench_residual(task, positions, forces, reactions)
    if not residual <= RESIDUAL:
        raise SolverFailed(f"the best plan misses Newton-Euler by {residual:.2g} of the object's weight")
    objective = plan_cost(task, sequence.modes, positions, forces)
    bound = min(float(outcome.bound) * task.weight**2, objective)
    closed = objective - bound <= max(gap * abs(objective), NEGLIGIBLE * task.weight**2) * (1 + 1e-9)
    return Plan(
        status="optimal" if closed else "feasible",
        objective=objective,
        bound=bound,
        seconds=time.perf_counter() - start,
        nodes=outcome.nodes,
        modes=sequence.modes,
        positions=positions,
        forces=forces,
        contact_forces=reactions,
        residual=residual,
        reason="" if closed else "the budget was spent before the gap closed",
    )
