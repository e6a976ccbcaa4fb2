"""What a cage problem asks of its fingers beyond caging: grippers and costs, as rows of the model (Thesis 5.1.7)."""

import numpy as np

from expert.caging.model import SweptModel
from expert.geometry.pose import Array, rotation
from expert.loops.swept import REACH
from expert.mip.backends import Solver
from expert.mip.linear import Term
from expert.problems.cage import CageProblem
from expert.world.fingers import Gripper
from expert.world.frame import Frame

DIRECTIONS = 16
"""Distances are bounded in so many directions."""
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
        limit = _parallel_jaws if problem.parallel else _free_jaws
        limit(model, gripper, least, most, axis)
    if problem.cost == "min_separation":
        _separation(model, problem.count, solver, best / frame.radius**2)
    if problem.cost == "max_opening":
        _opening(model, problem.count, to_relative, -best / frame.radius)


def _parallel_jaws(model: SweptModel, gripper: Gripper, least: float, most: float, axis: Array) -> None:
    """Jaws face each other along the axis: fingers[1] - fingers[0] = opening * axis."""
    a, b = (model.finger(k) for k in gripper.fingers)
    across = np.array([-axis[1], axis[0]])
    model.milp.equal([(across, b), (-across, a)], 0.0)
    model.milp.at_most([(axis, b), (-axis, a)], most)
    model.milp.at_most([(-axis, b), (axis, a)], -least)


def _free_jaws(model: SweptModel, gripper: Gripper, least: float, most: float, axis: Array) -> None:
    """At most `most` apart in every direction of a polygon inside the circle, at least `least` in one of them."""
    a, b = (model.finger(k) for k in gripper.fingers)
    u = _circle(DIRECTIONS)
    apart = [(u, np.broadcast_to(b, u.shape)), (-u, np.broadcast_to(a, u.shape))]
    model.milp.at_most(apart, np.full(DIRECTIONS, most * np.cos(np.pi / DIRECTIONS)))
    if least > 0:
        chosen = model.milp.binaries(DIRECTIONS)
        model.milp.equal([(1.0, chosen)], 1.0)
        big = 4 * REACH
        negated = [(-u, np.broadcast_to(b, u.shape)), (u, np.broadcast_to(a, u.shape))]
        model.milp.at_most([*negated, (big, chosen[:, None])], np.full(DIRECTIONS, big - least))


def _separation(model: SweptModel, count: int, solver: Solver, best: float) -> None:
    """J1, the sum of squared distances between all fingers; for a linear solver, from below by tangents to a few per cent."""
    pairs = [(model.finger(i), model.finger(j)) for i in range(count) for j in range(i)]
    if solver != "highs":
        model.milp.minimise([], [(1.0, a, b) for a, b in pairs])
        return
    squares = model.milp.add((len(pairs),), 0.0, 8 * REACH**2)
    lengths = model.milp.add((len(pairs),), 0.0, 3 * REACH)
    u = _circle(DIRECTIONS)
    at = np.geomspace(0.01, 3 * REACH, TANGENTS)
    for k, (a, b) in enumerate(pairs):
        apart: list[Term] = [(u, np.broadcast_to(a, u.shape)), (-u, np.broadcast_to(b, u.shape))]
        model.milp.at_most([*apart, (-1.0, np.repeat(lengths[k], DIRECTIONS))], np.zeros(DIRECTIONS))
        tangents: list[Term] = [
            (2 * at, np.repeat(lengths[k], TANGENTS)),
            (-1.0, np.repeat(squares[k], TANGENTS)),
        ]
        model.milp.at_most(tangents, at**2)
    model.milp.minimise([(1.0, squares)])
    if np.isfinite(best):
        model.milp.at_most([(1.0, squares)], (1 - GAIN) * best)


def _circle(count: int) -> Array:
    angles = 2 * np.pi * np.arange(count) / count
    return np.column_stack([np.cos(angles), np.sin(angles)])


def _opening(model: SweptModel, count: int, to_relative: Array, best: float) -> None:
    """J2 = -alpha: two fingers open along x, three along the tripod's directions."""
    least = (1 + GAIN) * best if np.isfinite(best) else 0.0
    alpha = model.milp.add((1,), min(least, 2 * REACH), 2 * REACH)
    if count == 2:
        axis = to_relative @ np.array([1.0, 0.0])
        ends = [(axis, model.finger(1)), (-axis, model.finger(0))]
        model.milp.equal([*ends, (-1.0, alpha)], 0.0)
    else:
        centre = model.milp.add((2,), -REACH, REACH)
        for k in range(3):
            u = to_relative @ TRIPOD[k]
            terms = [(1.0, model.finger(k)), (-1.0, centre), (-u, np.repeat(alpha, 2))]
            model.milp.equal(terms, np.zeros(2))
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
