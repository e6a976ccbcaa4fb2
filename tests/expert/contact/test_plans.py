"""Cost and residual of plans made by hand, against the checker's own statements."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from expert.contact import solve
from expert.contact.plans import contact_forces, plan_cost, wrench_residual
from expert.mechanics import external_contacts
from expert.problems.contact import Cost
from expert.verify.plan import check
from tests.support.hand_plans import WEIGHT, lifted_block, pushed_block, sliding_block
from tests.support.random_tasks import floor_task

HAND_MADE: list[Callable] = [sliding_block, pushed_block, lifted_block]


@pytest.mark.parametrize("make", HAND_MADE)
def test_hand_made_plans_balance_and_cost_what_the_checker_says(make: Callable) -> None:
    task, plan = make()
    assert wrench_residual(task, plan.positions, plan.forces, plan.contact_forces) < 1e-12
    dear = replace(task, cost=Cost(force=2.0, acceleration=0.5, margin=0.3))
    for t in (task, dear):
        cost = plan_cost(t, plan.modes, plan.positions, plan.forces)
        assert cost == pytest.approx(check.plan_cost(t, plan), rel=1e-12)


def test_a_force_that_is_missing_is_the_residual() -> None:
    task, plan = lifted_block()
    forces = plan.forces.copy()
    forces[1, 0] += [0.0, 0.25 * WEIGHT]
    assert wrench_residual(task, plan.positions, forces, plan.contact_forces) >= 0.25 - 1e-12


def test_weights_of_rays_become_the_forces_of_their_contacts() -> None:
    task = floor_task(np.random.default_rng(1))
    weights = np.random.default_rng(0).uniform(0, 1, (task.steps, 8))
    forces = contact_forces(task, weights)
    contacts = external_contacts(task)
    assert [(f.step, f.wall, f.vertex) for f in forces] == [(c.step, c.wall, c.vertex) for c in contacts]
    used = np.zeros(task.steps, dtype=int)
    for force, contact in zip(forces, contacts, strict=True):
        count = len(contact.rays)
        share = weights[contact.step, used[contact.step] :][:count]
        used[contact.step] += count
        np.testing.assert_allclose(force.force, task.weight * share @ contact.rays)
    nothing = contact_forces(task, -weights)
    assert nothing == ()


def test_the_objective_of_a_solved_task_is_its_plan_s_cost() -> None:
    task = floor_task(np.random.default_rng(5), margin=0.3)
    plan = solve(task)
    cost = plan_cost(task, plan.modes, plan.positions, plan.forces)
    assert plan.objective == cost
    assert cost == pytest.approx(check.plan_cost(task, plan), rel=1e-9)
