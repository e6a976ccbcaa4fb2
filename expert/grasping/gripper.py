"""Parallel-jaw grippers as rows on finger positions, and who of the labelled fingers goes where (Thesis 5.2.5)."""

import itertools

import numpy as np

from expert.caging.requirements import DIRECTIONS
from expert.geometry.pose import Array, rotation
from expert.grasping.rows import Rows
from expert.problems.grasp import GraspProblem
from expert.world.fingers import Gripper
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
        if problem.parallel:
            axis = rotation(-problem.pose[2]) @ np.array([1.0, 0.0])
            parts.append(_parallel(count, i, j, axis, gripper, frame.radius))
        else:
            parts.append(_free(count, i, j, towards[j] - towards[i], gripper, frame.radius))
    return Rows.join(parts)


def _between(count: int, i: int, j: int, directions: Array, low: Array, high: Array) -> Rows:
    """low <= u . (p_j - p_i) <= high for directions u (m, 2)."""
    V = np.zeros((len(directions), count, 2))
    V[:, i], V[:, j] = -directions, directions
    return Rows(V, low, high)


def _parallel(count: int, i: int, j: int, axis: Array, gripper: Gripper, radius: float) -> Rows:
    """p_j - p_i = opening * axis."""
    least, most = (length / radius for length in gripper.opening)
    across = np.array([-axis[1], axis[0]])
    return _between(count, i, j, np.stack([axis, across]), np.array([least, 0.0]), np.array([most, 0.0]))


def _free(count: int, i: int, j: int, along: Array, gripper: Gripper, radius: float) -> Rows:
    """At most `most` apart in the directions of a polygon, at least `least` along the given one."""
    least, most = (length / radius for length in gripper.opening)
    angles = np.arctan2(along[1], along[0]) + 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    u = np.column_stack([np.cos(angles), np.sin(angles)])
    low = np.where(np.arange(DIRECTIONS) == 0, least, -np.inf)
    return _between(count, i, j, u, low, np.full(DIRECTIONS, most * np.cos(np.pi / DIRECTIONS)))
