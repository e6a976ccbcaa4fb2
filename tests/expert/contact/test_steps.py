"""Wrench cones of one step: closed forms and certified bounds against sampling and scanning."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from expert.contact.scaled import ScaledTask
from expert.contact.steps import cost_bound, gain, reach, shortfall, solve_step, tighten
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
    status, _, bound, y, _ = solve_step(scaled, t, facets, lo, hi)
    for _ in range(10):
        rho = rng.uniform(lo, hi)
        inside, cost, below, _, _ = solve_step(scaled, t, facets, rho, rho)
        if status == INFEASIBLE:
            assert shortfall(scaled, t, facets, lo, hi, y) > 0
            assert inside == INFEASIBLE
        elif inside == SOLVED:
            assert cost >= bound - 1e-9 * (1 + abs(cost))
            assert cost == pytest.approx(below, rel=1e-5, abs=1e-6)
            assert cost >= cost_bound(scaled, t, facets, rho, rho, rng.normal(size=3)) - 1e-9


def test_tightened_ranges_agree_with_a_scan() -> None:
    moved = 0
    for seed in range(12):
        scaled = ScaledTask.of(floor_task(np.random.default_rng(seed)))
        for on in ([0, 2], [1, 3], [1, 2]):
            facets, t = np.array(on), seed % 4
            lo, hi = np.full(2, 0.05), np.full(2, 0.95)
            kept = tighten(scaled, t, facets, lo, hi, 0, 0) and tighten(scaled, t, facets, lo, hi, 0, 1)
            grid = np.linspace(0.05, 0.95, 181)
            feasible = []
            for rho in grid:
                low, high = np.array([rho, 0.05]), np.array([rho, 0.95])
                if solve_step(scaled, t, facets, low, high)[0] != INFEASIBLE:
                    feasible.append(rho)
            if not feasible:
                assert not kept or solve_step(scaled, t, facets, lo, hi)[0] != INFEASIBLE
                continue
            moved += lo[0] > 0.05 or hi[0] < 0.95
            assert kept
            assert lo[0] <= feasible[0] + 1e-9
            assert hi[0] >= feasible[-1] - 1e-9
            assert lo[0] >= feasible[0] - 0.005 - 1e-3
            assert hi[0] <= feasible[-1] + 0.005 + 1e-3
    assert moved >= 3
