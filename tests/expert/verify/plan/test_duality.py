"""The terms of dual bounds against maxima over samples."""

import numpy as np
import pytest

from expert.geometry.polygon import signed_distance
from expert.geometry.pose import to_body
from expert.problems.contact import ContactTask, Robustness
from expert.verify.plan.duality import Duality
from tests.support.random_tasks import floor_task

ROBUST = Robustness(cone_fraction=0.7, min_normal_force=0.1, free_clearance=0.004)


def drawn(seed: int) -> ContactTask:
    rng = np.random.default_rng(seed)
    return floor_task(rng, robustness=ROBUST if seed % 2 else None, margin=0.3 if seed % 3 else 0.0)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("free_of_cost", [True, False])
def test_no_force_in_the_cone_gains_more(seed: int, free_of_cost: bool) -> None:
    bounds, rng = Duality(drawn(seed)), np.random.default_rng(seed)
    for _ in range(20):
        t, f, rho, y = (
            int(rng.integers(bounds.steps)),
            int(rng.integers(4)),
            rng.random(),
            3 * rng.normal(size=3),
        )
        normal = np.concatenate([np.linspace(bounds.least, bounds.most, 400), [bounds.least, bounds.most]])
        tangential = np.linspace(-1, 1, 401)[:, None] * bounds.friction * normal
        force = normal[..., None] * bounds.normal[t, f] + tangential[..., None] * bounds.tangent[t, f]
        arm = bounds.place(t, f, rho) - bounds.centre[t]
        gained = force @ y[:2] + y[2] * (arm[0] * force[..., 1] - arm[1] * force[..., 0])
        if not free_of_cost:
            reward = bounds.beta * (bounds.true_friction * normal - np.abs(tangential))
            gained = gained + reward - bounds.force_weight * (normal**2 + tangential**2)
        most = bounds.gain(t, f, rho, y, free_of_cost)
        assert most >= gained.max() - 1e-12
        assert most == pytest.approx(gained.max(), abs=2e-2 * (1 + np.abs(y).sum()))


def test_pulls_are_the_derivative_of_the_linearised_cost() -> None:
    bounds, rng = Duality(drawn(1)), np.random.default_rng(0)
    a, p = rng.normal(size=(bounds.steps - 2, 2)), rng.normal(size=(bounds.steps, 2))
    bends = p[2:] - 2 * p[1:-1] + p[:-2]
    assert (bounds.pulls(a) * p).sum() == pytest.approx(2 * bounds.smooth_weight * (a * bends).sum())


@pytest.mark.parametrize("seed", range(4))
def test_free_fingers_are_clear_of_the_object_in_every_region_and_nowhere_else(seed: int) -> None:
    task = drawn(seed)
    bounds, rng = Duality(task), np.random.default_rng(seed)
    for region in range(bounds.regions):
        corners = bounds.free_corners(1, region)
        if not len(corners):
            continue
        inside = rng.dirichlet(np.ones(len(corners)), 50) @ corners
        places = to_body(task.trajectory.poses[1], inside * bounds.L + bounds.origin)
        assert signed_distance(task.body.vertices, places).min() >= task.robustness.free_clearance - 1e-9
