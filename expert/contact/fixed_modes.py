"""Plans at given contact modes: each mode sequence is a convex program up to the torque's product of position and force.

One compiled pass bounds all sequences; a small best-first search closes what it leaves open; a polish ends at the point
where the quadratic program 4-CT6 has its optimum too.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from expert.budget import Budget
from expert.contact.box import Box
from expert.contact.plan_at import plan_at
from expert.contact.polish import polish
from expert.contact.ranges import narrow
from expert.contact.relaxation import Goal, relax
from expert.contact.scaled import ScaledTask
from expert.contact.sequence import sequence_of
from expert.contact.tree import Best, Tree
from expert.errors import SolverFailed
from expert.geometry.pose import Array
from expert.numeric.qp import compiled
from expert.problems.contact import ContactTask, Plan
from expert.world.values import IntArray

ROUNDS = 12
"""Master programs per sequence in the first pass."""


@dataclass(frozen=True)
class AtModes:
    """plan: the best one, None where there is none.  bounds (k,): no plan of a sequence costs less (inf: proved to have
    none), [SI].  undecided: the search stopped before every sequence was settled."""

    plan: Plan | None
    bounds: Array
    undecided: bool


def plan_at_modes(task: ContactTask, modes: IntArray, *, gap: float, node_limit: int) -> AtModes:
    """The best plan with one of the mode sequences (k, T, C), to a relative `gap`; node_limit: boxes after the first pass."""
    scaled = ScaledTask.of(task)
    first = _screen(scaled, modes, gap / 2, False)
    tree = Tree(scaled, modes.shape[2], gap)
    best = int(first.costs.argmin())
    if np.isfinite(first.costs[best]):
        sequence = sequence_of(scaled, modes[best])
        tree.best = Best(float(first.costs[best]), sequence, first.points[best, : sequence.size])
    for k in np.argsort(first.bounds, kind="stable"):
        cost, bound = first.costs[k], first.bounds[k]
        closed = np.isfinite(cost) and cost - bound <= gap * abs(cost)
        if bound < tree.cutoff and not closed:
            sequence = sequence_of(scaled, modes[k])
            tree.offer(
                float(bound), sequence, *(end[k, : sequence.lo.size] for end in (first.low, first.high))
            )
    outcome = tree.run(Budget(np.inf), node_limit)
    return AtModes(_polished(task, scaled, outcome.best), scaled.cost_unit * first.bounds, outcome.limited)


def costs_at_modes(task: ContactTask, modes: IntArray, *, gap: float) -> tuple[Array, Array]:
    """Bounds and costs (k,) [SI] of all mode sequences (k, T, C) after one pass; cost inf: no plan found."""
    scaled = ScaledTask.of(task)
    first = _screen(scaled, modes, gap, True)
    return scaled.cost_unit * first.bounds, scaled.cost_unit * first.costs


class Screened(NamedTuple):
    """Bounds and costs (k,) of sequences, their boxes low, high (k, TC) of contact positions and best points (k, 2TC)."""

    bounds: Array
    costs: Array
    low: Array
    high: Array
    points: Array


@compiled
def _screen(scaled: ScaledTask, modes: IntArray, gap: float, everyone: bool) -> Screened:
    """Unless `everyone` is to get a cost, sequences that cannot beat the best so far are left with a bound above it."""
    N, T, C = modes.shape
    bounds, costs = np.full(N, np.inf), np.full(N, np.inf)
    low, high, points = np.zeros((N, T * C)), np.zeros((N, T * C)), np.zeros((N, 2 * T * C))
    best = np.inf
    for k in range(N):
        sequence = sequence_of(scaled, modes[k])
        lo, hi = sequence.lo.copy(), sequence.hi.copy()
        if not narrow(scaled, sequence, lo, hi)[0]:
            continue
        goal = Goal(np.inf if everyone else best, gap, ROUNDS)
        found = relax(scaled, Box(sequence, lo, hi, np.full((T, C), -1)), goal)
        bounds[k], costs[k] = found.bound, found.cost
        low[k, : lo.size], high[k, : lo.size] = lo, hi
        points[k, : found.z.size] = found.z
        best = min(best, found.cost)
    return Screened(bounds, costs, low, high, points)


def _polished(task: ContactTask, scaled: ScaledTask, best: Best) -> Plan | None:
    """None where forces do not balance numerically, or there is nothing to polish."""
    if best.sequence is None:
        return None
    z = polish(scaled, best.sequence, best.z, Budget(np.inf)).z
    try:
        return plan_at(task, scaled, best.sequence, z, status="feasible")
    except SolverFailed:
        return None
