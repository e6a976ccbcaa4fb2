"""Parallel-jaw grippers as rows on finger positions, and who of the labelled fingers goes where (Thesis 5.2.5)."""

import itertools

import numpy as np

from expert.geometry.pose import Array, rotation
from expert.grasping.rows import Rows
from expert.loops.jaws import free_jaws, parallel_jaws
from expert.problems.grasp import GraspProblem
from expert.world.frame import Frame

Places = tuple[int, ...]
"""places[f] is the place of finger f in the order of the cell; places without a gripper are given in increasing order."""


def placements(problem: GraspProblem) -> list[Places]:
    """All different ways to put labelled fingers into the places of a cell; one where no gripper tells them apart."""
    ways: dict[tuple, Places] = {}
    for places in itertools.permutations(range(problem.count)):
        held = [(places[g.fingers[0]], places[g.fingers[1]]) for g in problem.grippers]
        key = tuple(pair if problem.parallel else tuple(sorted(pair)) for pair in held)
        ways.setdefault(key, places)
    return list(ways.values())


def jaws(problem: GraspProblem, frame: Frame, places: Places, towards: Array) -> Rows:
    """Rows that keep each gripper's fingers within its opening, in the order of the cell.

    towards (N, 2): roughly where the fingers are; a free gripper keeps its least opening in the direction between them.
    """
    count = problem.count
    parts = [Rows(np.empty((0, count, 2)), np.empty(0), np.empty(0))]
    for gripper in problem.grippers:
        i, j = (places[f] for f in gripper.fingers)
        least, most = (length / frame.radius for length in gripper.opening)
        if problem.parallel:
            limits = parallel_jaws(least, most, rotation(-problem.pose[2]) @ np.array([1.0, 0.0]))
        else:
            limits = free_jaws(most, towards[j] - towards[i])
            limits.low[0] = least
        V = np.zeros((len(limits.u), count, 2))
        V[:, i], V[:, j] = -limits.u, limits.u
        parts.append(Rows(V, limits.low, limits.high))
    return Rows.join(parts)
