"""A time limit is processor time, kept to within 10 % and a second by every kind and method, on objects that are hard."""

import numpy as np
import pytest

from expert.budget import Budget
from expert.caging.synthesis import solve as cage
from expert.geometry.pose import Array
from expert.grasping.synthesis import solve as grasp
from expert.problems.cage import CageProblem
from expert.problems.grasp import GraspProblem
from expert.world.shape import Shape
from tests.support.polygons import HARD, hard_polygon, regular_polygon

LIMIT = 1.5


def spent(kind: str, method: str, vertices: Array) -> float:
    """Processor time [s] of a search with this limit; the shape is about 0.1 m large."""
    shape, pose, budget = Shape(vertices=vertices), np.zeros(3), Budget(np.inf)
    if kind == "cage":
        cage(CageProblem(shape=shape, pose=pose, count=3), method=method, time_limit=LIMIT)  # type: ignore[arg-type]
    else:
        grasp(GraspProblem(shape=shape, pose=pose), method=method, time_limit=LIMIT)  # type: ignore[arg-type]
    return budget.spent


@pytest.fixture(scope="module", autouse=True)
def compiled() -> None:
    """Numba's code is loaded, or compiled, before time is taken."""
    for kind, method in (("cage", "swept"), ("grasp", "goal_cell")):
        spent(kind, method, 0.1 * hard_polygon(np.random.default_rng(3), "comb"))


@pytest.mark.parametrize(("kind", "method"), [("cage", "swept"), ("grasp", "goal_cell")])
@pytest.mark.parametrize(("family", "seed"), [("gear", 0), ("ring", 1028)])
def test_gears_and_rings_overrun_no_limit(kind: str, method: str, family: str, seed: int) -> None:
    assert spent(kind, method, 0.1 * hard_polygon(np.random.default_rng(seed), family)) <= 1.1 * LIMIT + 1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "method"),
    [
        ("cage", "swept"),
        ("cage", "model"),
        ("grasp", "goal_cell"),
        ("grasp", "decomposed"),
        ("grasp", "miqp1"),
        ("grasp", "miqp2"),
    ],
)
def test_no_hard_object_overruns_a_limit(kind: str, method: str) -> None:
    shapes = {
        f"{family} {k}": 0.1 * hard_polygon(np.random.default_rng(k), family)
        for family in HARD
        for k in range(3)
    }
    shapes |= {f"{n} facets": regular_polygon(n, 0.05) for n in (12, 20, 48)}
    over = {name: t for name, v in shapes.items() if (t := spent(kind, method, v)) > 1.1 * LIMIT + 1}
    assert not over
