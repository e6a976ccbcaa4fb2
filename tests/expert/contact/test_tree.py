"""Boxes split into parts that cover them, and a search that closes its gap over given sequences."""

import numpy as np
import pytest

from expert.budget import Budget
from expert.contact import solve
from expert.contact.scaled import ScaledTask
from expert.contact.sequence import sequence_of
from expert.contact.tree import AtRho, ByRegion, Node, Tree
from expert.problems.contact import FREE
from tests.support.random_tasks import floor_task

MODES = np.array([[0, FREE], [0, 2], [FREE, 2], [FREE, 2]])


@pytest.fixture
def node() -> Node:
    s = sequence_of(ScaledTask.of(floor_task(np.random.default_rng(1))), MODES)
    return Node.root(s, s.lo, s.hi)


def test_halves_share_one_end(node: Node) -> None:
    at = 0.5 * (node.box.lo[1] + node.box.hi[1])
    below, above = node.at_rho(1, at)
    assert node.split == AtRho(1, at)
    assert below.box.hi[1] == above.box.lo[1] == at
    np.testing.assert_array_equal(below.box.lo, node.box.lo)
    np.testing.assert_array_equal(above.box.hi, node.box.hi)


def test_a_free_finger_gets_one_part_for_each_region(node: Node) -> None:
    parts = node.by_region(2, 0, 4)
    assert node.split == ByRegion(2, 0)
    assert [part.box.assigned[2, 0] for part in parts] == [0, 1, 2, 3]
    assert (node.box.assigned == -1).all()


def test_the_search_over_one_sequence_finds_its_best_plan() -> None:
    task = floor_task(np.random.default_rng(1))
    plan = solve(task)
    scaled = ScaledTask.of(task)
    s = sequence_of(scaled, plan.modes)
    tree = Tree(scaled, 2, 1e-3)
    tree.offer(-np.inf, s, s.lo, s.hi)
    outcome = tree.run(Budget(np.inf))
    assert not outcome.limited
    assert outcome.best.cost == pytest.approx(plan.objective / task.weight**2, rel=2e-3)
    assert outcome.best.cost - outcome.bound <= 1e-3 * outcome.best.cost


def test_a_spent_budget_stops_before_the_first_box() -> None:
    s = sequence_of(ScaledTask.of(floor_task(np.random.default_rng(1))), MODES)
    tree = Tree(ScaledTask.of(floor_task(np.random.default_rng(1))), 2, 1e-3)
    tree.offer(0.5, s, s.lo, s.hi)
    for outcome in (tree.run(Budget(0.0)), tree.run(Budget(np.inf), 0)):
        assert outcome.limited
        assert outcome.nodes == 0
        assert outcome.bound == 0.5
