"""What an answer claims beyond caging: that its grippers can hold the fingers, and what the fingers cost (Thesis 5.1.7).

Written from the definitions, without the rows of the model that found the answer.
"""

import itertools

import numpy as np

from expert.geometry.pose import Array
from expert.problems.cage import CageProblem, CageSolution
from expert.verify.grippers import TOLERANCE, direction_fault, opening_fault

CLAIMED = ("topology", "seconds", "attempts", "refuted", "unconfirmed", "reason")
"""Fields of an answer that say how it was found: nothing here depends on them."""


def unmet_claim(task: CageProblem, answer: CageSolution) -> str:
    """The first claim that the answer's fingers do not keep; empty if they keep all."""
    size = task.shape.size
    return (
        opening_fault(task.grippers, answer.fingers, size)
        or (direction_fault(task.grippers, answer.fingers, size, task.direction) if task.parallel else "")
        or _cost(task, answer)
    )


def _cost(task: CageProblem, answer: CageSolution) -> str:
    """Recomputed from the fingers and compared with what the answer states."""
    p, size = answer.fingers, task.shape.size
    if task.cost == "none":
        return (
            f"a cost of {answer.objective:.6g}, where none was asked for"
            if np.isfinite(answer.objective)
            else ""
        )
    if task.cost == "min_separation":
        cost, scale = sum(float((a - b) @ (a - b)) for a, b in itertools.combinations(p, 2)), size**2
    else:
        opening, misfit = _tripod(p) if task.count == 3 else (float(p[1, 0] - p[0, 0]), 0.0)
        if misfit > TOLERANCE * size:
            return f"a finger is {misfit:.3g} m off the one-parameter gripper that opens by {opening:.4g} m"
        if opening < -TOLERANCE * size:
            return f"the gripper opens by {opening:.4g} m"
        cost, scale = -opening, size
    if not abs(cost - answer.objective) <= TOLERANCE * max(abs(cost), TOLERANCE * scale):
        return f"the cost is {cost:.6g}, not {answer.objective:.6g}"
    return ""


def _tripod(p: Array) -> tuple[float, float]:
    """Opening [m] of the gripper p_k = c + opening u_k nearest to three fingers, and the largest distance from it [m].

    u = (0, 1), (-1, -1) / sqrt 2, (1, -1) / sqrt 2: fingers 1 and 2 are level, sqrt 2 openings apart.
    """
    opening = float(p[2, 0] - p[1, 0]) / np.sqrt(2)
    diagonal = opening / np.sqrt(2)
    centre = (p[1] + p[2]) / 2 + [0, diagonal]
    expected = centre + np.array([[0, opening], [-diagonal, -diagonal], [diagonal, -diagonal]])
    return opening, float(np.linalg.norm(p - expected, axis=1).max())
