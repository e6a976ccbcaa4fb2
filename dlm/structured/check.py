"""The convex check of proposed contact classes: least cost of each, proofs where there is none, and the best plan.

Each class is a mode sequence; over a box of contact positions it is a convex program up to the torque's product of
position and force (`expert.contact.leaf`).  One compiled pass bounds all proposals; a small best-first search closes what
it leaves open; a polish ends at the point where the quadratic program 4-CT6 has its optimum too.
"""

from dataclasses import dataclass

import numpy as np

from expert.contact.exact import RESIDUAL
from expert.contact.leaf import narrow, relax
from expert.contact.model import Model, model_of
from expert.contact.plan_at import all_forces, positions_at
from expert.contact.polish import polish
from expert.contact.recovery import plan_cost, wrench_residual
from expert.contact.search import Best, Tree
from expert.contact.sequence import sequence_of
from expert.errors import SolverFailed
from expert.geometry.pose import Array
from expert.numeric.qp import compiled
from expert.problems.contact import ContactTask, Plan
from expert.world.values import IntArray

ROUNDS = 12
"""Master programs per class in the first pass."""
GAP = 1e-3
NODES = 100
"""Boxes that the search may visit after the first pass."""


@dataclass(frozen=True)
class Checked:
    """What the check found among the proposals.

    plan: the best one, None where there is none.  bounds (k,): no plan of a class costs less (inf: proved to have none),
    in (m g)^2.  undecided: the search stopped before every class was settled.
    """

    plan: Plan | None
    bounds: Array
    undecided: bool


def check(
    task: ContactTask, modes: IntArray, *, node_limit: int = NODES, model: Model | None = None
) -> Checked:
    """The best plan with one of the mode sequences (k, T, C).  `model`: of this task, if it is there already."""
    model = model or model_of(task)
    first = screen(model, modes, GAP / 2, ROUNDS, False)
    tree = Tree(model, modes.shape[2], GAP)
    best, bounds = int(first[1].argmin()), first[0]
    if np.isfinite(first[1][best]):
        sequence = sequence_of(model, modes[best])
        tree.best = Best(float(first[1][best]), sequence, first[4][best, : sequence.size])
    for k in np.argsort(bounds, kind="stable"):
        if bounds[k] < tree.cutoff and not _closed(first[1][k], bounds[k]):
            sequence = sequence_of(model, modes[k])
            width = sequence.lo.size
            tree.offer(float(bounds[k]), sequence, first[2][k, :width], first[3][k, :width])
    outcome = tree.run(node_limit=node_limit, deadline=np.inf)
    return Checked(_plan(task, model, outcome.best), bounds, outcome.limited)


def _closed(cost: float, bound: float) -> bool:
    return bool(np.isfinite(cost) and cost - bound <= GAP * abs(cost))


@compiled
def screen(
    model: Model, modes: IntArray, gap: float, rounds: int, everyone: bool
) -> tuple[Array, Array, Array, Array, Array]:
    """Bounds and costs (k,) of the classes, their boxes lo, hi (k, TC) of contact positions and best points (k, 2TC).

    Unless `everyone` is to get a cost, classes that cannot beat the best one so far are left with a bound above it.
    """
    N, T, C = modes.shape
    bounds, costs = np.full(N, np.inf), np.full(N, np.inf)
    low, high, points = np.zeros((N, T * C)), np.zeros((N, T * C)), np.zeros((N, 2 * T * C))
    best = np.inf
    for k in range(N):
        sequence = sequence_of(model, modes[k])
        lo, hi = sequence.lo.copy(), sequence.hi.copy()
        if (lo > hi).any() or not narrow(model, sequence, lo, hi):
            continue
        target = np.inf if everyone else best
        found = relax(model, sequence, lo, hi, np.full((T, C), -1), target, gap, rounds)
        bounds[k], costs[k] = found.bound, found.cost
        low[k, : lo.size], high[k, : lo.size] = lo, hi
        points[k, : found.z.size] = found.z
        best = min(best, found.cost)
    return bounds, costs, low, high, points


def _plan(task: ContactTask, model: Model, best: Best) -> Plan | None:
    """Polished, with forces that balance; None where that fails numerically, or there is nothing to polish."""
    if best.sequence is None:
        return None
    z = polish(model, best.sequence, best.z).z
    positions = positions_at(task, model, best.sequence, z)
    try:
        forces, reactions = all_forces(task, model, best.sequence, z)
    except SolverFailed:
        return None
    residual = wrench_residual(task, positions, forces, reactions)
    if not residual <= RESIDUAL:
        return None
    return Plan(
        status="feasible",
        objective=plan_cost(task, best.sequence.modes, positions, forces),
        modes=best.sequence.modes,
        positions=positions,
        forces=forces,
        contact_forces=reactions,
        residual=residual,
    )
