"""What an answer claims beyond its path: that grippers can follow it, what it costs, and from where it succeeds (Thesis 5.2.5)."""

import numpy as np

from expert.geometry.polygon import signed_area
from expert.geometry.pose import Array
from expert.problems.grasp import GraspProblem, GraspSolution
from expert.verify.grippers import direction_fault, opening_fault

CLAIMED = ("method", "seconds", "refuted", "reason")
"""Fields of an answer that say how it was found: nothing here depends on them."""
TOLERANCE = 1e-6
"""Of a cost, relative to itself, and to what that share of the square of the object's size costs."""
WORLD_X = 0.0
"""Direction [rad] along which parallel grippers open."""


def gripper_fault(problem: GraspProblem, fingers: Array) -> str:
    """Which gripper cannot hold its fingers (N, 2) there; empty if all can."""
    size = problem.shape.size
    return opening_fault(problem.grippers, fingers, size) or (
        direction_fault(problem.grippers, fingers, size, WORLD_X) if problem.parallel else ""
    )


def cost_fault(problem: GraspProblem, answer: GraspSolution) -> str:
    """How the stated cost differs from the path's, or from the area of the starts that are promised; empty: not at all."""
    if not np.isfinite(answer.objective):
        return ""
    if problem.cost == "acceleration":
        cost = float((np.diff(answer.path, 2, axis=0) ** 2).sum())
    else:
        cost = abs(signed_area(answer.starts)) if len(answer.starts) > 2 else 0.0
    if abs(cost - answer.objective) <= TOLERANCE * max(cost, TOLERANCE * problem.shape.size**2):
        return ""
    return f"the cost is {cost:.6g}, not {answer.objective:.6g}"
