"""What a cage problem asks of its fingers beyond caging: grippers and costs, as rows of the model (Thesis 5.1.7)."""

import numpy as np

from expert.caging.frame import Frame
from expert.caging.model import SweptModel
from expert.caging.problem import CageProblem, Gripper
from expert.caging.swept import REACH
from expert.errors import InvalidProblem
from expert.geometry.pose import Array, rotation
from expert.mip.backends import Solver

DIRECTIONS = 16
"""Distances are bounded in so many directions."""
TRIPOD = np.array([[0.0, 1.0], [-np.sqrt(0.5), -np.sqrt(0.5)], [np.sqrt(0.5), -np.sqrt(0.5)]])
"""Directions in which the fingers of a three-finger gripper open (Thesis 5.1.7)."""


def require(model: SweptModel, problem: CageProblem, frame: Frame, solver: Solver) -> None:
    """Add gripper limits and the cost to a model."""
    to_relative = rotation(-problem.pose[2])
    for gripper in problem.grippers:
        least, most = (length / frame.radius for length in gripper.opening)
        limit = _parallel_jaws if problem.parallel else _free_jaws
        limit(model, gripper, least, most, to_relative @ np.array([1.0, 0.0]))
    if problem.cost == "min_separation":
        _separation(model, problem.count, solver)
    if problem.cost == "max_opening":
        _opening(model, problem.count, to_relative)


def _parallel_jaws(model: SweptModel, gripper: Gripper, least: float, most: float, axis: Array) -> None:
    """Jaws face each other along the world's x axis: fingers[1] - fingers[0] = opening * axis."""
    a, b = (model.finger(k) for k in gripper.fingers)
    across = np.array([-axis[1], axis[0]])
    model.milp.equal([(across, b), (-across, a)], 0.0)
    model.milp.at_most([(axis, b), (-axis, a)], most)
    model.milp.at_most([(-axis, b), (axis, a)], -least)


def _free_jaws(model: SweptModel, gripper: Gripper, least: float, most: float, axis: Array) -> None:
    """At most `most` apart in every direction of a polygon inside the circle, at least `least` in one of them."""
    a, b = (model.finger(k) for k in gripper.fingers)
    angles = 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    u = np.column_stack([np.cos(angles), np.sin(angles)])
    apart = [(u, np.broadcast_to(b, u.shape)), (-u, np.broadcast_to(a, u.shape))]
    model.milp.at_most(apart, np.full(DIRECTIONS, most * np.cos(np.pi / DIRECTIONS)))
    if least > 0:
        chosen = model.milp.binaries(DIRECTIONS)
        model.milp.equal([(1.0, chosen)], 1.0)
        big = 4 * REACH
        negated = [(-u, np.broadcast_to(b, u.shape)), (u, np.broadcast_to(a, u.shape))]
        model.milp.at_most([*negated, (big, chosen[:, None])], np.full(DIRECTIONS, big - least))


def _separation(model: SweptModel, count: int, solver: Solver) -> None:
    """J1: sum of squared distances between all fingers; for a linear solver, of distances in the sum norm."""
    for i in range(count):
        for j in range(i):
            a, b = model.finger(i), model.finger(j)
            if solver == "highs":
                d = model.milp.add((2,), 0.0, 2 * REACH)
                model.milp.at_most([(1.0, a), (-1.0, b), (-1.0, d)], np.zeros(2))
                model.milp.at_most([(-1.0, a), (1.0, b), (-1.0, d)], np.zeros(2))
                model.milp.minimise([(1.0, d)])
            else:
                model.milp.minimise([], [(1.0, a, b)])


def _opening(model: SweptModel, count: int, to_relative: Array) -> None:
    """J2 = -alpha: two fingers open along x, three along the tripod's directions."""
    alpha = model.milp.add((1,), 0.0, 2 * REACH)
    if count == 2:
        axis = to_relative @ np.array([1.0, 0.0])
        ends = [(axis, model.finger(1)), (-axis, model.finger(0))]
        model.milp.equal([*ends, (-1.0, alpha)], 0.0)
    elif count == 3:
        centre = model.milp.add((2,), -REACH, REACH)
        for k in range(3):
            u = to_relative @ TRIPOD[k]
            terms = [(1.0, model.finger(k)), (-1.0, centre), (-u, np.repeat(alpha, 2))]
            model.milp.equal(terms, np.zeros(2))
    else:
        raise InvalidProblem(
            "cost",
            expected="max_opening with 2 or 3 fingers",
            got=f"{count} fingers",
            remedy="choose another cost",
        )
    model.milp.minimise([(-1.0, alpha)])


def objective(problem: CageProblem, fingers: Array) -> float:
    """The cost of given fingers (count, 2): J1 [m^2], minus the opening [m], or nan."""
    if problem.cost == "min_separation":
        gaps = fingers[:, None] - fingers[None]
        return float((gaps**2).sum() / 2)
    if problem.cost == "max_opening":
        if problem.count == 2:
            return float(fingers[0, 0] - fingers[1, 0])
        # p_k = c + alpha u_k
        u = TRIPOD - TRIPOD.mean(axis=0)
        return -float((u * (fingers - fingers.mean(axis=0))).sum() / (u**2).sum())
    return float("nan")
