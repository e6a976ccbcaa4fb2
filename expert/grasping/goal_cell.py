"""Fingers for a goal cell: one small linear program per knot.  Knots only meet in the smoothness cost."""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from expert.budget import UNLIMITED, Budget
from expert.geometry.cover import clip
from expert.geometry.polygon import signed_area
from expert.geometry.pose import Array
from expert.grasping.cell import LEAST_MOMENT, GoalCell
from expert.grasping.facets import Facets, tuples
from expert.grasping.rows import Rows
from expert.loops.normals import rays
from expert.loops.swept import FARTHEST
from expert.mip.backends import Answer, StandardForm, highs

DIRECTIONS = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
"""r_h of 5-CT16."""
MIN_WEIGHT, SUM_WEIGHT = 0.5, 0.125
"""The region of attraction counts min_h alpha_h and sum_h alpha_h with these weights."""


MOST_CUTS = 15
"""Linear programs for one largest start."""


@dataclass(frozen=True)
class Candidate:
    """A goal cell whose every knot exists, with its largest start.

    attraction: objective there; start (N, 2): fingers there; firmest: largest moment that can hold the object in the end.
    """

    cell: GoalCell
    attraction: float
    start: Array
    firmest: float


def cells(
    table: Facets, count: int, margin: float, least: float = LEAST_MOMENT, budget: Budget = UNLIMITED
) -> Iterator[GoalCell]:
    """Facets and rays that may hold the object at the goal: moments of both senses of at least `least` are within reach.

    Where two fingers share a facet, changing places exchanges the rays: one order of these is enough.
    """
    for chosen in tuples(table, count):
        if budget.over:
            return
        reachable = _moments(table, chosen, margin)
        if count == 3:
            cell = GoalCell(table, chosen, 0, 0, margin, least=least)
            if cell.E[0] > 0 and reachable[0, 0] < 0 < reachable[0, 1]:
                yield cell
            continue
        for up, down in ((0, 1), (1, 0)) if len(set(chosen)) == count else ((0, 1),):
            if reachable[up, 0] < -least and reachable[down, 1] > least:
                yield GoalCell(table, chosen, up, down, margin, least=least)


def _moments(table: Facets, chosen: tuple[int, ...], margin: float) -> Array:
    """Least and largest f'(0) = sum lambda tangent . p (k, 2) of each ray with contacts anywhere on the facets."""
    index = list(chosen)
    weights = rays(table.normals[index])
    ends = np.column_stack([table.low[index] + margin, table.high[index] - margin])
    return np.column_stack([weights @ ends.min(axis=1), weights @ ends.max(axis=1)])


def hold(cell: GoalCell) -> float:
    """The smaller of the two moments with which contacts anywhere on the facets can hold the object at the goal."""
    reachable = _moments(cell.table, cell.chosen, cell.margin)
    return float(min(-reachable[cell.up, 0], reachable[cell.down, 1]))


def solve_rows(rows: Rows, extra: int, cost: Array, more: Array, more_low: Array) -> Answer:
    """Minimise cost over fingers and `extra` further variables >= 0; more @ x >= more_low."""
    fingers = rows.V.reshape(len(rows.V), -1)
    n = fingers.shape[1] + extra
    A = np.vstack([np.hstack([fingers, np.zeros((len(fingers), extra))]), more])
    norms = np.maximum(np.abs(A).max(axis=1, initial=1e-12), 1e-12)
    low = np.concatenate([rows.low, more_low]) / norms
    high = np.concatenate([rows.high, np.full(len(more_low), np.inf)]) / norms
    box = np.concatenate([np.full(n - extra, FARTHEST), np.full(extra, 2 * FARTHEST)])
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


def largest_start(cell: GoalCell, rows: Rows, p: Array) -> tuple[float, Array]:
    """Largest area of the cell at the goal's angle, to 1 %, from fingers p (N, 2): area and fingers.

    The root of the area of {x : A x <= b} is concave in b (Brunn, Minkowski) and b is affine in p.  Its derivative by b
    is edge lengths over twice the root: Kelley's cutting planes.
    """
    best, best_p = 0.0, p
    more, low = np.empty((0, p.size + 1)), np.empty(0)
    for _ in range(MOST_CUTS):
        area, lengths = _area_and_edges(cell, p)
        if area > best:
            best, best_p = area, p
        root = np.sqrt(max(area, 1e-12))
        slope = (lengths[:, None] * cell.normals / (2 * root)).ravel()
        more, low = np.vstack([more, np.append(slope, -1.0)]), np.append(low, slope @ p.ravel() - root)
        answer = solve_rows(rows, 1, np.append(np.zeros(p.size), -1.0), more, low)
        if answer.x is None or answer.x[-1] <= 1.005 * np.sqrt(best):
            break
        p = answer.x[:-1].reshape(-1, 2)
    return best, best_p


def _area_and_edges(cell: GoalCell, p: Array) -> tuple[float, Array]:
    """Area of the cell at the goal's angle, and the length of its edge on each finger's line (N,)."""
    polygon = region(cell, p)
    if len(polygon) < 3:
        return 0.0, np.ones(cell.count)
    A, b = cell.slice(p)
    following = np.roll(polygon, -1, axis=0)
    middles = (polygon + following) / 2
    on = np.abs(middles @ A.T - b).argmin(axis=1)
    lengths = np.bincount(on, np.linalg.norm(following - polygon, axis=1), cell.count)
    return abs(signed_area(polygon)), np.asarray(lengths, dtype=float)


def firmest_end(cell: GoalCell, reach: float) -> float | None:
    """Largest moment that both rays can have at the last knot; None where it does not exist."""
    if cell.concurrent:
        return None if some_knot(cell, cell.end(reach)) is None else 0.0
    count, moments = 2 * cell.count, cell.moments().V.reshape(2, -1)
    more = np.column_stack([moments, -np.ones(2)])
    answer = solve_rows(cell.end(reach), 1, np.append(np.zeros(count), -1.0), more, np.zeros(2))
    return None if answer.x is None else float(answer.x[-1])


def can_end(cell: GoalCell) -> bool:
    """Whether fingers anywhere on the facets, and as the grippers allow, can hold the object at the goal at all."""
    index = list(cell.chosen)
    along = Rows(
        np.eye(cell.count)[:, :, None] * cell.table.tangents[index],
        cell.table.low[index],
        cell.table.high[index],
    )
    return some_knot(cell, Rows.join([*cell.held(), along])) is not None


def some_knot(cell: GoalCell, rows: Rows) -> Array | None:
    """Fingers (N, 2) that meet all rows."""
    size = 2 * cell.count
    answer = solve_rows(rows, 0, np.zeros(size), np.empty((0, size)), np.empty(0))
    return None if answer.x is None else answer.x.reshape(-1, 2)


def candidate(cell: GoalCell, half_ranges: Array) -> Candidate | None:
    """The best start and some end of a goal cell whose every knot exists."""
    best = start_knot(
        cell, cell.knot(half_ranges[0], half_ranges[0])
    )  # mostly what fails, where anything does
    if best is None:
        return None
    firmest = firmest_end(cell, half_ranges[-2])
    if firmest is None:
        return None
    for reach, limit in itertools.pairwise(half_ranges[:-1]):
        if some_knot(cell, cell.knot(reach, limit)) is None:
            return None
    return Candidate(cell, best[0], best[1], firmest)


def region(cell: GoalCell, p: Array) -> Array:
    """Polygon (M, 2) of translations at the goal's angle that the cell holds, fingers p (N, 2)."""
    A, b = cell.slice(p)
    square = 2 * FARTHEST * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    return clip(square, A, b)
