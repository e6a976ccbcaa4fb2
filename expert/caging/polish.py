"""Local search for a better cost: fingers of a cage move a little, and each step must be verified before the next.

It needs no model of why the cage is one, and leaves a rotation range of the ladder behind.
"""

from collections.abc import Iterator

import numpy as np

from expert.caging.requirements import TRIPOD, objective
from expert.geometry.pose import Array
from expert.problems.cage import CageProblem

STEPS = (0.2, 0.1, 0.05, 0.025, 0.0125, 0.006)
"""Largest move of a finger, relative to the object's size."""
TRIES = 8
"""Directions tried at each step size before it is reduced."""


def moves(problem: CageProblem) -> Array:
    """Independent motions (k, count, 2) of the searched fingers that keep them a one-parameter gripper where asked."""
    count = problem.count
    if problem.cost == "max_opening" and count == 3:
        shifts = np.broadcast_to(np.eye(2)[:, None], (2, 3, 2))
        return np.concatenate([shifts, TRIPOD[None]])
    return np.eye(2 * count).reshape(2 * count, count, 2)


def improvements(
    problem: CageProblem, fingers: Array, step: float, rng: np.random.Generator
) -> Iterator[Array]:
    """Fingers (count, 2) [m] of lower cost, at most step [m] from the given ones: straight downhill, then at random."""
    basis = moves(problem)
    width = 1e-4 * problem.shape.size
    here = objective(problem, fingers)
    slope = np.array([objective(problem, fingers + width * move) - here for move in basis])
    for k in range(TRIES):
        weights = -slope / max(float(np.linalg.norm(slope)), 1e-300)
        if k:
            weights = weights + rng.normal(size=len(basis))
        move = np.tensordot(weights, basis, axes=1)
        length = np.linalg.norm(move, axis=1).max()
        moved = fingers + step / max(float(length), 1e-300) * move
        if objective(problem, moved) < here:
            yield moved
