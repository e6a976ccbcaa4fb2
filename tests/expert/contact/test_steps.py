"""Wrench cones of one step: closed forms and certified bounds against sampling and scanning."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from expert.contact.scaled import ScaledTask
from expert.contact.steps import Stance, cost_bound, gain, reach, shortfall, solve_step, step_program
from expert.geometry.pose import cross
from expert.numeric.qp import INFEASIBLE, SOLVED
from expert.problems.contact import Robustness
from tests.support.random_tasks import floor_task, table_task

TASKS: list[ScaledTask] = [
    ScaledTask.of(floor_task(np.random.default_rng(1))),
    ScaledTask.of(floor_task(np.random.default_rng(2), margin=0.4)),
    ScaledTask.of(
        floor_task(np.random.default_rng(5), robustness=Robustness(cone_fraction=0.7, min_normal_force=0.05))
    ),
    ScaledTask.of(table_task(np.random.default_rng(4))),
]
numbers = st.floats(-20, 20)


@settings(max_examples=60, deadline=None)
@given(
    st.sampled_from(TASKS), st.integers(0, 3), st.integers(0, 3), st.floats(0, 1), numbers, numbers, numbers
)
def test_gain_and_reach_are_the_maxima_over_the_friction_cone(
    scaled: ScaledTask, t: int, f: int, rho: float, a: float, b: float, c: float
) -> None:
    y = np.array([a, b, c])
    normal = np.linspace(scaled.min_force, scaled.max_force, 401)[:, None]
    tangential = scaled.friction * normal * np.linspace(-1, 1, 401)
    force = normal[..., None] * scaled.normal[t, f] + tangential[..., None] * scaled.tangent[t, f]
    arm = scaled.arm[t, f] + rho * scaled.edge[t, f]
    wrench = np.concatenate([force, cross(arm, force)[..., None]], axis=-1)
    margin = scaled.margin_weight * (scaled.true_friction * normal - np.abs(tangential))
    value = wrench @ y - scaled.force_weight * (force**2).sum(-1) + margin
    assert gain(scaled, t, f, rho, y) >= value.max() - 1e-9
    assert gain(scaled, t, f, rho, y) <= value.max() + 0.02 * (1 + np.abs(y).max())  # the grid's width
    assert reach(scaled, t, f, rho, y) == pytest.approx((wrench @ y).max(), abs=1e-9)


@settings(max_examples=60, deadline=None)
@given(st.sampled_from(TASKS), st.integers(0, 3), st.lists(numbers, min_size=3, max_size=3))
def test_gain_is_convex_along_a_facet(scaled: ScaledTask, f: int, y: list[float]) -> None:
    values = np.array([gain(scaled, 0, f, rho, np.array(y)) for rho in np.linspace(0, 1, 21)])
    assert (np.diff(values, 2) >= -1e-9 * (1 + np.abs(values).max())).all()


@settings(max_examples=60, deadline=None)
@given(
    st.sampled_from(TASKS),
    st.integers(0, 3),
    st.lists(st.integers(0, 3), min_size=1, max_size=2),
    st.integers(0, 2**20),
)
def test_no_contact_positions_in_the_box_cost_less_than_its_bound(
    scaled: ScaledTask, t: int, on: list[int], seed: int
) -> None:
    rng = np.random.default_rng(seed)
    facets = np.array(on)
    lo, hi = np.sort(rng.uniform(0, 1, (2, len(on))), axis=0)
    stance = Stance(t, facets, lo, hi)
    least = solve_step(scaled, stance)
    for _ in range(10):
        rho = rng.uniform(lo, hi)
        there = Stance(t, facets, rho, rho)
        inside = solve_step(scaled, there)
        if least.status == INFEASIBLE:
            assert shortfall(scaled, stance, least.y) > 0
            assert inside.status == INFEASIBLE
        elif inside.status == SOLVED:
            assert inside.cost >= least.bound - 1e-9 * (1 + abs(inside.cost))
            assert inside.cost == pytest.approx(inside.bound, rel=1e-5, abs=1e-6)
            assert inside.cost >= cost_bound(scaled, there, rng.normal(size=3)) - 1e-9


@pytest.mark.parametrize("case", range(4))
def test_the_forces_found_balance_the_step_within_their_cones(case: int) -> None:
    scaled, seen = TASKS[case], 0
    for t in range(scaled.steps):
        for on in itertools.combinations(range(scaled.facets), 2):
            rho = np.full(2, 0.4)
            stance = Stance(t, np.array(on), rho, rho)
            found = solve_step(scaled, stance)
            if found.status == SOLVED:
                seen += 1
                program = step_program(scaled, stance)
                np.testing.assert_allclose(program.A[:3] @ found.x, scaled.required[t], atol=1e-8)
                assert (program.A[3:] @ found.x >= program.b[3:] - 1e-8).all()
    assert seen > 0
