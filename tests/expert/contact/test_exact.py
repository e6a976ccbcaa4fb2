"""The exact solver against enumeration, its promises under budgets and failures, and laws that optima obey."""

import itertools
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from expert.budget import Budget
from expert.contact import scaled, solve
from expert.contact.exact import warm_up
from expert.contact.plan_at import forces_at
from expert.contact.scaled import ScaledTask
from expert.contact.search import Search
from expert.contact.sequence import sequence_of
from expert.errors import SolverFailed
from expert.files import read_problem
from expert.geometry.pose import Array, rotation
from expert.numeric import fallback
from expert.problems.contact import FREE, ContactTask, Robustness
from expert.verify.plan.check import check_plan, verify
from expert.world.motion import Trajectory
from tests.support.feasible_tasks import feasible_task
from tests.support.random_tasks import floor_task, table_task

GALLERY = Path(__file__).parents[3] / "configs" / "problem" / "contact_trajectory"
ROBUST = Robustness(
    cone_fraction=0.7, support_inset=0.3, min_normal_force=0.04, min_interval=2, free_clearance=0.005
)


def drawn(seed: int, **options: Any) -> ContactTask:
    rng = np.random.default_rng(seed)
    return floor_task(rng, **options) if seed % 2 else table_task(rng, **options)


def least_over_grid(m: ScaledTask, fingers: int, width: int) -> float:
    """Cheapest plan over all mode sequences without a free step in between and a grid of contact positions [(m g)^2].

    Such fingers are pressed on one facet all the time, or arrive, or leave: the smoothing cost of their free steps is 0.
    """
    facets, best = m.facets, np.inf
    stays = [
        tuple(f if first <= t <= last else FREE for t in range(m.steps))
        for f in range(facets)
        for first, last in itertools.combinations_with_replacement(range(m.steps), 2)
    ]
    single = [(FREE,) * m.steps, *stays]
    for modes in itertools.combinations_with_replacement(single, fingers):
        s = sequence_of(m, np.array(modes).T.copy())
        if (s.lo > s.hi).any():
            continue
        for rho in itertools.product(*(np.linspace(a, b, width) for a, b in zip(s.lo, s.hi, strict=True))):
            z = s.reference.copy()
            z[: len(rho)] = rho
            z = _free_at_rest(s, z)
            best = min(best, forces_at(m, s, z).cost)
    return best


def _free_at_rest(s: Any, z: Array) -> Array:
    """Free positions that minimise the smoothing cost for given rho (regions left out)."""
    k = len(s.lo)
    if len(z) > k:
        z[k:] = np.linalg.lstsq(s.Q[k:, k:], -(s.q[k:] + s.Q[k:, :k] @ z[:k]), rcond=1e-12)[0]
    return z


@pytest.mark.parametrize("seed", range(6))
def test_one_finger_optimum_equals_enumeration_over_modes_and_a_fine_grid(seed: int) -> None:
    task = drawn(seed, facets=3, steps=3, fingers=1)
    scale = task.weight**2
    grid = least_over_grid(ScaledTask.of(task), 1, 400) * scale
    plan = solve(task)
    if plan.status == "infeasible":
        assert grid == np.inf
        return
    assert plan.status == "optimal"
    assert plan.bound <= grid * (1 + 1e-9)
    # the grid leaves out free regions and so may be lower, but never finds what the bound excludes
    assert plan.objective >= plan.bound


@pytest.mark.parametrize("seed", range(4))
def test_two_finger_optimum_is_no_worse_than_enumeration_over_modes_and_a_grid(seed: int) -> None:
    task = drawn(seed, facets=3, steps=2)
    plan = solve(task)
    grid = least_over_grid(ScaledTask.of(task), 2, 25) * task.weight**2
    assert plan.bound <= grid * (1 + 1e-9)
    if plan.status == "infeasible":
        assert grid == np.inf
    elif grid < np.inf:  # two steps have no smoothing cost, so that regions do not matter
        assert plan.objective <= grid * (1 + 1e-3)
        assert plan.objective >= grid * 0.9 - 1e-9  # no better than a fine grid can explain


@pytest.mark.parametrize("seed", range(16))
def test_every_plan_is_sound_and_its_gap_certified(seed: int) -> None:
    task = drawn(seed, margin=0.3) if seed % 4 == 1 else drawn(seed)
    plan = solve(replace(task, robustness=ROBUST) if seed % 3 == 0 else task)
    assert plan.status in ("optimal", "infeasible")
    if plan.found:
        assert plan.objective - plan.bound <= 1e-3 * abs(plan.objective) + 1e-9
        assert plan.residual <= 1e-8
        report = check_plan(replace(task, robustness=ROBUST) if seed % 3 == 0 else task, plan)
        assert report.verdict == "sound", report


@pytest.mark.parametrize("seed", [1, 3, 5, 7])
def test_more_friction_and_more_fingers_are_never_worse(seed: int) -> None:
    task = floor_task(np.random.default_rng(seed))
    reference = solve(task)
    more = replace(task, fingers=replace(task.fingers, count=3))
    rough = replace(task, fingers=replace(task.fingers, friction=2 * task.fingers.friction))
    for easier in (more, rough):
        plan = solve(easier)
        assert plan.bound <= reference.objective
        assert plan.found or not reference.found


@pytest.mark.parametrize("seed", [0, 2, 4])
def test_transverse_optimum_does_not_depend_on_where_the_table_lies(seed: int) -> None:
    task = table_task(np.random.default_rng(seed))
    turn = np.array([0.3, -2.0, 0.7])
    moved_by, mirrored_by = solve(moved(task, turn)), solve(mirrored(task))
    reference = solve(task)
    for plan in (moved_by, mirrored_by):
        assert plan.status == reference.status
        assert plan.objective == pytest.approx(reference.objective, rel=2e-3)


def moved(task: ContactTask, by: Array) -> ContactTask:
    poses = task.trajectory.poses
    centres = poses[:, :2] @ rotation(by[2]).T + by[:2]
    return replace(
        task,
        trajectory=Trajectory.of(np.column_stack([centres, poses[:, 2] + by[2]]), task.trajectory.dt),
    )


def mirrored(task: ContactTask) -> ContactTask:
    flip = np.array([-1.0, 1.0])
    body = replace(task.body, vertices=(task.body.vertices * flip)[::-1])
    poses = task.trajectory.poses * [-1.0, 1.0, -1.0]
    return replace(task, body=body, trajectory=Trajectory.of(poses, task.trajectory.dt))


def test_an_object_at_rest_needs_no_finger() -> None:
    task = drawn(3)
    still = np.tile(task.trajectory.poses[0], (4, 1))
    plan = solve(replace(task, trajectory=Trajectory.of(still, 0.1, "rest")))
    assert plan.status == "optimal"
    assert plan.objective == pytest.approx(0.0, abs=1e-9)
    assert (plan.modes == FREE).all()


def test_contacts_last_two_steps_and_push_where_that_is_asked_for() -> None:
    for seed in (1, 3, 9, 11):
        plan = solve(floor_task(np.random.default_rng(seed), steps=5, robustness=ROBUST))
        assert plan.found
        for column, forces in zip(plan.modes.T, plan.forces.transpose(1, 0, 2), strict=True):
            start = 0
            for facet, run in itertools.groupby(column):
                length = len(list(run))
                if facet != FREE:
                    assert length >= 2
                    pushing = np.linalg.norm(forces[start : start + length - 1], axis=1)
                    assert (pushing >= ROBUST.min_normal_force - 1e-9).all()
                start += length


def test_a_node_budget_returns_the_best_plan_its_bound_and_its_gap_each_time_alike() -> None:
    task = floor_task(np.random.default_rng(7))
    answers = [solve(task, node_limit=12, gap=1e-6) for _ in range(2)]
    full = solve(task, gap=1e-3)
    assert answers[0].status == "feasible"
    assert answers[0].bound <= full.objective
    assert answers[0].objective >= full.bound
    assert answers[0].gap > 1e-6
    assert answers[0].objective == answers[1].objective
    np.testing.assert_array_equal(answers[0].positions, answers[1].positions)


def test_no_budget_at_all_is_a_limit_and_no_verdict() -> None:
    for plan in (solve(drawn(1), node_limit=0), solve(drawn(1), time_limit=0.0)):
        assert plan.status == "time_limit"
        assert not plan.found
        assert "budget" in plan.reason


def breaks_down(*_: Any) -> Any:
    raise RuntimeError("injected")


def test_without_the_fast_solver_the_fallbacks_find_the_same_optimum(monkeypatch: Any) -> None:
    task = drawn(3, facets=3, steps=3)
    reference = solve(task)
    warm_up()
    monkeypatch.setattr(scaled, "QP_ITERATIONS", 0)
    plan = solve(task, node_limit=300)
    assert plan.found
    assert plan.objective == pytest.approx(reference.objective, rel=2e-3)
    assert check_plan(task, plan).verdict == "sound"


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_failing_solvers_never_make_a_task_infeasible(seed: int, monkeypatch: Any) -> None:
    """Feasible and infeasible tasks alike: with every sub-solver broken, nothing is claimed."""
    task = drawn(seed, facets=3, steps=3, fingers=1 if seed == 3 else 2)
    warm_up()
    monkeypatch.setattr(fallback, "_clarabel", breaks_down)
    monkeypatch.setattr(scaled, "QP_ITERATIONS", 0)
    try:
        plan = solve(task, node_limit=300)
    except SolverFailed:
        return
    assert plan.status == "time_limit"


def test_bounds_without_any_working_solver_stay_below_the_optimum(monkeypatch: Any) -> None:
    task = drawn(1, facets=3, steps=3)
    best = solve(task).objective
    monkeypatch.setattr(fallback, "_clarabel", breaks_down)
    outcome = Search(ScaledTask.of(task)._replace(iterations=0), 2, 1e-3).run(Budget(np.inf), 50)
    assert outcome.bound * task.weight**2 <= best


@pytest.mark.parametrize("seed", range(24))
def test_what_has_a_plan_by_construction_is_never_infeasible(seed: int) -> None:
    """Also with forces exactly on edges of cones, at ends of margins, at the largest force, and about to tip."""
    task = feasible_task(seed)
    plan = solve(task)
    assert plan.found
    assert check_plan(task, plan).verdict == "sound"


@pytest.mark.slow
def test_all_of_five_hundred_feasible_tasks_are_solved_and_proved() -> None:
    for seed in range(500):
        task = feasible_task(seed)
        plan = solve(task, time_limit=10.0)
        assert plan.status == "optimal", seed
        report = verify(task, plan)
        assert report.verdict == "sound", f"{seed}: {report}"
        assert "bound" not in report.claimed


def test_a_margin_that_is_rewarded_a_lot_stays_well_conditioned() -> None:
    """One finger on a curved path: its forces follow from the motion, whatever distance from the cone's edge is worth."""
    problem = read_problem(GALLERY / "transverse_curved_push_one_finger.yaml")
    for margin in (0.1, 1.0, 30.0):
        task = replace(problem.task, cost=replace(problem.task.cost, margin=margin))
        plan = solve(task)
        assert plan.status == "optimal"
        assert check_plan(task, plan).verdict == "sound"


@pytest.mark.parametrize("seed", range(8))
def test_margins_of_any_worth_are_decided(seed: int) -> None:
    for margin in (0.1, 1.0):
        task = drawn(seed)
        task = replace(task, cost=replace(task.cost, margin=margin))
        plan = solve(task)
        assert plan.status in ("optimal", "infeasible")
        assert not plan.found or check_plan(task, plan).verdict == "sound"
