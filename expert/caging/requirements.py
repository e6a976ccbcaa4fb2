"""What a cage problem asks of its fingers beyond caging: grippers and costs, as rows of the model (Thesis 5.1.7)."""

import numpy as np

from expert.caging.model import SweptModel
from expert.geometry.pose import Array, rotation
from expert.loops.jaws import DIRECTIONS, circle, free_jaws, parallel_jaws
from expert.loops.swept import FARTHEST
from expert.mip.backends import Solver
from expert.problems.cage import CageProblem
from expert.world.fingers import Gripper
from expert.world.frame import Frame

TANGENTS = 24
"""Of the square of a distance, in a geometric series."""
GAIN = 0.01
"""A better cage must have a cost that is smaller by this share."""
TRIPOD = np.array([[0.0, 1.0], [-np.sqrt(0.5), -np.sqrt(0.5)], [np.sqrt(0.5), -np.sqrt(0.5)]])
"""Directions in which the fingers of a three-finger gripper open (Thesis 5.1.7)."""


def require(
    model: SweptModel,
    problem: CageProblem,
    frame: Frame,
    solver: Solver,
    direction: float = 0.0,
    best: float = np.nan,
) -> None:
    """Add to a model the gripper limits, with parallel ones opening along a world direction [rad], and the cost.

    Where a cost is known, only answers better than `best` by GAIN are of interest (nan: all).
    """
    to_relative = rotation(-problem.pose[2])
    axis = to_relative @ np.array([np.cos(direction), np.sin(direction)])
    for gripper in problem.grippers:
        least, most = (length / frame.radius for length in gripper.opening)
        _keep_jaws(model, gripper, least, most, problem.parallel, axis)
    if problem.cost == "min_separation":
        _separation(model, problem.count, solver, best / frame.radius**2)
    if problem.cost == "max_opening":
        _opening(model, problem.count, to_relative, -best / frame.radius)


def _keep_jaws(
    model: SweptModel, gripper: Gripper, least: float, most: float, parallel: bool, axis: Array
) -> None:
    """The opening, along the axis or in any direction: then it is at least `least` in one of several."""
    a, b = (model.finger(k) for k in gripper.fingers)
    jaws = parallel_jaws(least, most, axis) if parallel else free_jaws(most, np.array([1.0, 0.0]))
    apart = jaws.u @ (b - a)
    model.milp.between(jaws.low, apart, jaws.high)
    if least > 0 and not parallel:
        chosen = model.milp.binaries(len(jaws.u))
        big = 4 * FARTHEST
        model.milp.add(chosen.sum(axis=0) == 1, apart >= least - big * (1 - chosen))


def _separation(model: SweptModel, count: int, solver: Solver, best: float) -> None:
    """J1, the sum of squared distances between all fingers; for a linear solver, from below by tangents to a few per cent."""
    m = model.milp
    gaps = [model.finger(i) - model.finger(j) for i in range(count) for j in range(i)]
    if solver != "highs":
        for gap in gaps:
            m.minimise_squares(1.0, gap)
        return
    squares = m.variables((len(gaps),), 0.0, 8 * FARTHEST**2)
    lengths = m.variables((len(gaps),), 0.0, 3 * FARTHEST)
    at = np.geomspace(0.01, 3 * FARTHEST, TANGENTS)
    for k, gap in enumerate(gaps):
        m.add(circle(DIRECTIONS) @ gap <= lengths[k], 2 * at * lengths[k] - squares[k] <= at**2)
    m.minimise(squares)
    if np.isfinite(best):
        m.add(squares.sum(axis=0) <= (1 - GAIN) * best)


def _opening(model: SweptModel, count: int, to_relative: Array, best: float) -> None:
    """J2 = -alpha: two fingers open along x, three along the tripod's directions."""
    m = model.milp
    least = (1 + GAIN) * best if np.isfinite(best) else 0.0
    alpha = m.variables((1,), min(least, 2 * FARTHEST), 2 * FARTHEST)
    if count == 2:
        axis = to_relative @ np.array([1.0, 0.0])
        m.add(axis @ (model.finger(1) - model.finger(0)) == alpha[0])
    else:
        centre = m.variables((2,), -FARTHEST, FARTHEST)
        for k in range(3):
            m.add(model.finger(k) == centre + to_relative @ TRIPOD[k] * alpha)
    m.minimise(-alpha)


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
