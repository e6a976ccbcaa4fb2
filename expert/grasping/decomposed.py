"""The mixed-integer search taken apart: facets first, then topology at both ends of the path, then the path itself.

1. Final grasps are ranked by the moments that they can hold the object with.
2. For each, the model with the first and the last knot only chooses pieces, turns and fillings, for the largest start.
3. With these fixed the whole path is a convex program: least acceleration among those that keep the region of attraction.
"""

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import clarabel
import numpy as np
import scipy.sparse as sp

from expert.budget import Budget
from expert.geometry.pose import Array
from expert.grasping.cell import GoalCell
from expert.grasping.goal_cell import MIN_WEIGHT, SUM_WEIGHT
from expert.grasping.nested import FacetGeometry, NestedCages
from expert.loops.model import Knot
from expert.mip.backends import StandardForm


@dataclass(frozen=True)
class Topology:
    """All discrete choices of a nested-cage path, and the attraction alpha (4,) that its two end knots allow."""

    grasp: GoalCell
    hubs: tuple[int, int]
    meetings: tuple[tuple[int, int], ...]
    pairs: tuple[tuple[int, int], ...]
    alpha: Array
    value: float


def topologies(
    geometry: FacetGeometry, grasp: GoalCell, knots: Sequence[Knot], budget: Budget
) -> Iterator[Topology]:
    """For each filling the topology of the largest start, where the end knots of the grasp exist at all."""
    for hubs in fillings(grasp):
        model = NestedCages(geometry, [grasp], [knots[0], knots[-1]], hubs=hubs)
        if not model.feasible or budget.over:
            return
        model.maximise_attraction()
        x = model.milp.solve("highs", time_limit=budget.left).x
        if x is not None:
            yield topology_of(model, x)


def fillings(grasp: GoalCell) -> list[tuple[int, int]]:
    """Ways to fill the loop below and above the goal that agree with the rays which shut it there.

    The diagonal of a square of fingers must leave a ray's three fingers in one triangle, and join a ray's two.
    """
    if grasp.count == 3:
        return [(0, 0)]
    return list(itertools.product(_hubs(grasp.rays[grasp.down]), _hubs(grasp.rays[grasp.up])))


def _hubs(ray: Array) -> list[int]:
    support = np.flatnonzero(ray)
    if len(support) == 3:
        return [int(np.flatnonzero(ray == 0)[0] + 1) % 2]
    i, j = support
    return [int(i % 2)] if (j - i) % 2 == 0 else [0, 1]


def topology_of(model: NestedCages, x: Array) -> Topology:
    """The discrete choices of a solution."""
    alpha = model.alpha.at(x)
    return Topology(
        grasp=model.grasps[int(model.z.at(x).argmax())],
        hubs=model.hubs,
        meetings=tuple(model.keys[int(k)] for k in model.H.at(x).argmax(axis=1)),
        pairs=tuple(model.pairs[int(k)] for k in model.W.at(x).sum(axis=1).argmax(axis=1)),
        alpha=alpha,
        value=float(MIN_WEIGHT * alpha.min() + SUM_WEIGHT * alpha.sum()),
    )


def path_of(
    geometry: FacetGeometry, topology: Topology, knots: Sequence[Knot], finish: Callable[[NestedCages], None]
) -> Array | None:
    """Best path (K, N, 2) of a topology for the objective that `finish` adds; None where none was found."""
    model = NestedCages(geometry, [topology.grasp], knots, hubs=topology.hubs)
    if not model.feasible or any(key not in model.keys for key in topology.meetings):
        return None
    model.fix(topology.meetings, topology.pairs)
    finish(model)
    x = solve_convex(model.milp.form())
    return None if x is None else model.p.at(x)


def smooth_path(
    geometry: FacetGeometry, topology: Topology, knots: Sequence[Knot], share: float
) -> Array | None:
    """Smoothest path of a topology that keeps this share of its region of attraction."""

    def finish(model: NestedCages) -> None:
        model.milp.add(model.alpha >= share * topology.alpha)
        model.minimise_acceleration()

    return path_of(geometry, topology, knots, finish)


def solve_convex(form: StandardForm) -> Array | None:
    """Minimiser of a convex quadratic program; None where the interior-point method did not reach one."""
    A = sp.vstack([form.A, sp.eye_array(len(form.q))]).tocsr()
    low, high = np.concatenate([form.row_low, form.low]), np.concatenate([form.row_high, form.high])
    equal = low == high
    below, above = ~equal & np.isfinite(low), ~equal & np.isfinite(high)
    rows = sp.vstack([A[equal], A[above], -A[below]]).tocsc()
    right = np.concatenate([high[equal], high[above], -low[below]])
    cones = [clarabel.ZeroConeT(int(equal.sum())), clarabel.NonnegativeConeT(int(above.sum() + below.sum()))]
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    P = sp.triu(form.P).tocsc()
    solution = clarabel.DefaultSolver(P, form.q, rows, right, cones, settings).solve()
    return np.array(solution.x) if str(solution.status) == "Solved" else None
