"""Certificates prove what a search claims, and nothing that is false, to the checker, which knows nothing of the search."""

import base64
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from expert.contact import solve
from expert.contact.certificate import packed
from expert.files import read_problem
from expert.problems.contact import ContactTask, Plan, Robustness
from expert.verify.plan.optimality import objection
from tests.support.random_tasks import floor_task, table_task

DATA = Path(__file__).parents[2] / "data" / "contact"
ROBUST = Robustness(
    cone_fraction=0.7, support_inset=0.3, min_normal_force=0.04, min_interval=2, free_clearance=0.005
)


def proves(task: ContactTask, plan: Plan, bound: float, **changed: Any) -> bool:
    assert plan.certificate is not None
    return not objection(task, {**plan.certificate, **changed}, bound)


def drawn(seed: int) -> ContactTask:
    rng = np.random.default_rng(seed)
    margin, robustness = 0.3 * (seed % 4 == 1), ROBUST if seed % 3 == 0 else None
    return floor_task(rng, margin=margin, robustness=robustness) if seed % 2 else table_task(rng)


@pytest.mark.parametrize("seed", range(12))
def test_the_bound_of_every_search_is_proved_again(seed: int) -> None:
    task = drawn(seed)
    plan = solve(task)
    assert plan.status in ("optimal", "infeasible")
    assert proves(task, plan, plan.bound)


@pytest.mark.parametrize("seed", [1, 3, 5, 7])
def test_no_more_is_proved_than_is_true(seed: int) -> None:
    task = drawn(seed)
    plan = solve(task)
    assert plan.found
    assert not proves(task, plan, 1.001 * plan.objective)


@pytest.mark.parametrize("name", ["sq_pivot1", "sd_pivot1", "tri_pivot1", "pl_rot1"])
def test_that_there_is_no_plan_is_proved_again(name: str) -> None:
    task = read_problem(DATA / f"{name}.json").task
    plan = solve(task)
    assert plan.status == "infeasible"
    assert proves(task, plan, np.inf)


@pytest.mark.parametrize("seed", [30, 42, 54, 64])
def test_that_no_sequence_of_contacts_fits_together_is_proved_again(seed: int) -> None:
    """Every step can be balanced by one finger, but not by one that stays where it is."""
    task = table_task(np.random.default_rng(seed), facets=3 + seed % 3, steps=5, fingers=1)
    plan = solve(task)
    assert plan.status == "infeasible"
    assert plan.reason.startswith("no consistent contact sequence")
    assert proves(task, plan, np.inf)
    assert not proves(task, plan, np.inf, sequences=[])  # steps alone do not show it


def test_a_certificate_without_its_steps_or_sequences_proves_nothing() -> None:
    task = drawn(3)
    plan = solve(task)
    assert plan.certificate is not None
    size = len(np.frombuffer(base64.b64decode(plan.certificate["steps"])))
    assert not proves(task, plan, plan.bound, steps=packed(np.zeros(size)))
    assert not proves(task, plan, plan.bound, sequences=[])


def test_a_budget_spent_leaves_a_bound_that_is_proved() -> None:
    task = floor_task(np.random.default_rng(7))
    plan = solve(task, node_limit=12, gap=1e-6)
    assert plan.status == "feasible"
    assert proves(task, plan, plan.bound)
