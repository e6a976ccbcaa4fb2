"""Fingers for a goal cell: one small linear program per knot.  Knots only meet in the smoothness cost."""

import itertools
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from expert.geometry.cover import clip
from expert.geometry.pose import Array, cross
from expert.grasping.cell import LEAST_MOMENT, GoalCell
from expert.grasping.facets import Facets, rays, tuples
from expert.grasping.rows import Rows
from expert.mip.backends import Answer, StandardForm, highs

REACH = 4.0
"""Fingers stay within this distance (in enclosing radii) of the goal, per coordinate."""
DIRECTIONS = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
"""r_h of 5-CT16."""
MIN_WEIGHT, SUM_WEIGHT = 0.5, 0.125
"""The region of attraction counts min_h alpha_h and sum_h alpha_h with these weights."""


@dataclass(frozen=True)
class Candidate:
    """A goal cell whose end and start knots exist; attraction: objective at the start; start, end (N, 2)."""

    cell: GoalCell
    attraction: float
    start: Array
    end: Array


def cells(table: Facets, count: int, margin: float) -> list[GoalCell]:
    """Facets and rays that may hold the object at the goal: moments of both senses are within reach of the contacts."""
    found = []
    for chosen in tuples(table, count):
        reachable = _moments(table, chosen, margin)
        for up, down in ((0, 1), (1, 0)):
            if reachable[up, 0] < -LEAST_MOMENT and reachable[down, 1] > LEAST_MOMENT:
                found.append(GoalCell(table, chosen, up, down, margin))
    return found


def _moments(table: Facets, chosen: tuple[int, ...], margin: float) -> Array:
    """Least and largest f'(0) (k, 2) of each ray with contacts anywhere on the facets."""
    index = list(chosen)
    weights = rays(table.normals[index])
    # f'(0) = sum lambda (perp n) . p, and perp n = tangent for an outward normal of a counter-clockwise polygon ...
    turning = cross(table.normals[index], table.tangents[index])
    ends = turning[:, None] * np.column_stack([table.low[index] + margin, table.high[index] - margin])
    return np.column_stack([weights @ ends.min(axis=1), weights @ ends.max(axis=1)])


def solve_rows(rows: Rows, extra: int, cost: Array, more: Array, more_low: Array) -> Answer:
    """Minimise cost over fingers and `extra` further variables >= 0; more @ x >= more_low."""
    fingers = rows.V.reshape(len(rows.V), -1)
    n = fingers.shape[1] + extra
    A = np.vstack([np.hstack([fingers, np.zeros((len(fingers), extra))]), more])
    norms = np.maximum(np.abs(A).max(axis=1, initial=1e-12), 1e-12)
    low = np.concatenate([rows.low, more_low]) / norms
    high = np.concatenate([rows.high, np.full(len(more_low), np.inf)]) / norms
    box = np.concatenate([np.full(n - extra, REACH), np.full(extra, 2 * REACH)])
    form = StandardForm(
        P=sp.coo_array((n, n)),
        q=cost,
        A=sp.csr_array(A / norms[:, None]),
        row_low=low,
        row_high=high,
        low=np.concatenate([-box[: n - extra], np.zeros(extra)]),
        high=box,
        integral=np.zeros(n, dtype=bool),
    )
    return highs(form, 0.0, 10.0)


def start_knot(cell: GoalCell, rows: Rows) -> tuple[float, Array] | None:
    """Largest region of attraction: objective and fingers (N, 2).  5-CT16: q + alpha_h r_h is in the cell at the goal's angle."""
    count, h = cell.count, len(DIRECTIONS)
    more = np.zeros((count * h + h, 2 * count + h + 1))
    goal = cell.clearance()
    for k in range(h):
        block = slice(k * count, (k + 1) * count)
        more[block, : 2 * count] = goal.V.reshape(count, -1)
        more[block, 2 * count + k] = -(cell.normals @ DIRECTIONS[k])
        more[count * h + k, [2 * count + k, 2 * count + h]] = 1.0, -1.0
    cost = np.concatenate([np.zeros(2 * count), np.full(h, -SUM_WEIGHT), [-MIN_WEIGHT]])
    low = np.concatenate([np.tile(goal.low, h), np.zeros(h)])
    answer = solve_rows(rows, h + 1, cost, more, low)
    if answer.x is None:
        return None
    return float(-cost @ answer.x), answer.x[: 2 * count].reshape(count, 2)


def some_knot(cell: GoalCell, rows: Rows) -> Array | None:
    """Fingers (N, 2) that meet all rows."""
    size = 2 * cell.count
    answer = solve_rows(rows, 0, np.zeros(size), np.empty((0, size)), np.empty(0))
    return None if answer.x is None else answer.x.reshape(-1, 2)


def candidate(cell: GoalCell, half_ranges: Array) -> Candidate | None:
    """The best start and some end of a goal cell whose every knot exists."""
    end = some_knot(cell, cell.end(half_ranges[-2]))
    if end is None:
        return None
    best = start_knot(cell, cell.knot(half_ranges[0], half_ranges[0]))
    if best is None:
        return None
    for reach, limit in itertools.pairwise(half_ranges[:-1]):
        if some_knot(cell, cell.knot(reach, limit)) is None:
            return None
    return Candidate(cell, best[0], best[1], end)


def region(cell: GoalCell, p: Array) -> Array:
    """Polygon (M, 2) of translations at the goal's angle that the cell holds, fingers p (N, 2)."""
    A, b = cell.slice(p)
    square = 2 * REACH * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    return clip(square, A, b)
