"""The convex check of proposed contact classes: least cost of each, proofs where there is none, and the best plan."""

from expert.contact.fixed_modes import AtModes, plan_at_modes
from expert.problems.contact import ContactTask
from expert.world.values import IntArray

GAP = 1e-3
NODES = 100
"""Boxes that the search may visit after the first pass."""


def check(task: ContactTask, modes: IntArray, *, node_limit: int = NODES) -> AtModes:
    """The best plan with one of the mode sequences (k, T, C)."""
    return plan_at_modes(task, modes, gap=GAP, node_limit=node_limit)
