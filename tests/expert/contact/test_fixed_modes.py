"""Plans at given modes: the optimum's modes give the optimum, hopeless modes are proved so."""

import numpy as np
import pytest

from expert.contact import solve
from expert.contact.fixed_modes import costs_at_modes, plan_at_modes
from expert.problems.contact import FREE
from expert.verify.plan.check import check_plan
from tests.support.random_tasks import floor_task, table_task

GAP = 1e-3


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_the_optimum_s_modes_give_the_optimum(seed: int) -> None:
    rng = np.random.default_rng(seed)
    task = floor_task(rng) if seed % 2 else table_task(rng)
    best = solve(task)
    assert best.found
    found = plan_at_modes(task, best.modes[None], gap=GAP, node_limit=100)
    assert not found.undecided
    assert found.plan is not None
    assert found.plan.objective == pytest.approx(best.objective, rel=2 * GAP)
    assert found.bounds[0] <= found.plan.objective * (1 + 1e-9)
    assert check_plan(task, found.plan).verdict == "sound"


def test_of_many_sequences_the_best_is_taken_and_none_costs_less_than_its_bound() -> None:
    task = floor_task(np.random.default_rng(1))
    best = solve(task)
    facets = len(task.body.vertices)
    others = [np.tile([a, b], (task.steps, 1)) for a in range(facets) for b in range(a + 1, facets)]
    modes = np.stack([*others, best.modes])
    found = plan_at_modes(task, modes, gap=GAP, node_limit=100)
    assert found.plan is not None
    assert found.plan.objective == pytest.approx(best.objective, rel=2 * GAP)
    bounds, costs = costs_at_modes(task, modes, gap=GAP)
    known = np.isfinite(bounds)
    assert known.any()
    assert (costs[known] >= bounds[known] - 1e-9 * (1 + np.abs(bounds[known]))).all()
    assert costs.min() >= best.bound


def test_idle_fingers_move_nothing() -> None:
    task = floor_task(np.random.default_rng(1))
    found = plan_at_modes(task, np.full((1, task.steps, 2), FREE), gap=GAP, node_limit=10)
    assert found.plan is None
    assert found.bounds[0] == np.inf
    assert not found.undecided
