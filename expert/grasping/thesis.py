"""MIQP1 and MIQP2 of Thesis 5.2.5 and 5.2.6 as mixed-integer programs over all knots and all final grasps.

    minimise    sum |p''|^2  (- alpha, MIQP2)
    subject to  caging at every knot            5-CT12, 13   loops, winding, filled limits
                convergence                     5-CT14, 15   prescribed half-ranges, a final grasp on facets
                observability                   5-CT17..19   as first-order form closure
                region of attraction (MIQP2)    5-CT16

All blocks live in `expert.grasping.nested`, where what had to be mended is named.  Discrete choices are made by a linear
solver with accelerations in the sum norm, one program for each filling of the limits; with these choices fixed the path
is the minimiser of the quadratic program as stated above.
"""

import heapq
import itertools
from collections.abc import Iterator, Sequence
from typing import Literal

from expert.budget import Budget
from expert.geometry.pose import Array
from expert.grasping.cell import GoalCell
from expert.grasping.decomposed import Topology, fillings, path_of, topology_of
from expert.grasping.nested import FacetGeometry, NestedCages
from expert.loops.model import Knot

BEND_WEIGHT = 0.1
"""Weight of accelerations in the sum norm against alpha (both in enclosing radii)."""
PROGRAM_SHARE = 0.2
"""Share of the time that each program may take."""
MOST_CUTS = 6
"""Solutions that each program gives before it is left."""
Name = Literal["miqp1", "miqp2"]


def finish(model: NestedCages, name: Name) -> None:
    """The objective of 5-MIQP1, or of 5-MIQP2, as a quadratic program."""
    model.minimise_acceleration()
    if name == "miqp2":
        model.milp.minimise(-model.common_alpha())


def solutions(
    geometry: FacetGeometry, grasps: Sequence[GoalCell], knots: Sequence[Knot], name: Name, budget: Budget
) -> Iterator[tuple[Topology, Array]]:
    """Topologies and paths (K, N, 2), the best first; each is cut off when the next one is asked for."""
    order, seconds = itertools.count(), PROGRAM_SHARE * budget.left
    queue: list[tuple[float, int, int, NestedCages, Array]] = []

    def push(model: NestedCages, cuts: int) -> None:
        answer = model.milp.solve("highs", gap=0.01, time_limit=budget.part(seconds).left)
        if answer.x is not None:
            value = float(model.milp.form().q @ answer.x)
            heapq.heappush(queue, (value, next(order), cuts, model, answer.x))

    programs: dict[tuple[int, int], list[GoalCell]] = {}
    for grasp in grasps:
        for hubs in fillings(grasp):
            programs.setdefault(hubs, []).append(grasp)
    took = 0.0
    for hubs, alike in programs.items():
        if budget.left <= took:  # another one would take as long
            return
        begun = budget.spent
        model = NestedCages(geometry, alike, knots, hubs=hubs)
        if model.feasible:
            model.minimise_bends(1.0 if name == "miqp1" else BEND_WEIGHT)
            if name == "miqp2":
                model.milp.minimise(-model.common_alpha())
            push(model, 0)
        took = budget.spent - begun
    while queue:
        _, _, cuts, model, x = heapq.heappop(queue)
        topology = topology_of(model, x)
        path = path_of(geometry, topology, knots, lambda m: finish(m, name))
        if path is not None:
            yield topology, path
        if cuts < MOST_CUTS:
            model.cut(x)
            push(model, cuts + 1)
