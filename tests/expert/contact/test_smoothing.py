"""Least smoothing cost of one finger against sampled paths and a quadratic program in cvxpy."""

import cvxpy as cp
import numpy as np
import pytest

from expert.contact.box import Box, standing_rows
from expert.contact.scaled import ScaledTask
from expert.contact.sequence import sequence_of, smoothing
from expert.contact.smoothing import least_smoothing
from expert.problems.contact import FREE
from tests.support.random_tasks import floor_task

COLUMNS = [[3, 3, FREE, 1, 1], [2, FREE, FREE, 2, FREE], [FREE, 1, 1, FREE, FREE], [1, 1, 1, 1, 1]]


@pytest.mark.parametrize("column", COLUMNS)
@pytest.mark.parametrize("region", [-1, 0])
def test_the_bound_is_the_optimum_of_the_quadratic_program(column: list[int], region: int) -> None:
    scaled = ScaledTask.of(floor_task(np.random.default_rng(6), steps=5))
    modes = np.array(column)[:, None]
    assigned = np.where(modes == FREE, region, -1)
    bound, step, slopes = least_smoothing(scaled, modes, assigned)
    s = sequence_of(scaled, modes)
    assert not (s.lo > s.hi).any()
    A, b = standing_rows(scaled, Box(s, s.lo, s.hi, assigned), s.size)
    z = cp.Variable(s.size)
    p = cp.reshape((s.map[:, 0].reshape(-1, s.size)) @ z + s.offset[:, 0].ravel(), (5, 2), order="C")
    cost = scaled.acceleration_weight * cp.sum_squares(p[2:] - 2 * p[1:-1] + p[:-2])
    problem = cp.Problem(cp.Minimize(cost), [A @ z >= b])
    problem.solve(solver=cp.CLARABEL)
    assert problem.status == "optimal"
    assert bound == pytest.approx(problem.value, rel=1e-4, abs=1e-3)
    assert bound <= problem.value + 1e-6 * (1 + problem.value)
    assert slopes.shape == (3, 2)
    assert (step < 0) or assigned[step, 0] < 0


def test_no_path_is_smoother_than_said() -> None:
    scaled, rng = ScaledTask.of(floor_task(np.random.default_rng(6), steps=5)), np.random.default_rng(0)
    for column in COLUMNS:
        modes = np.array(column)[:, None]
        bound, _, _ = least_smoothing(scaled, modes, np.full_like(modes, -1))
        s = sequence_of(scaled, modes)
        for _ in range(50):
            rho = rng.uniform(s.lo, s.hi)
            z = np.concatenate([rho, s.reference[len(rho) :] + rng.normal(0, 0.3, s.size - len(rho))])
            assert smoothing(s, z) >= bound - 1e-9


def test_a_facet_that_a_wall_closes_has_no_room() -> None:
    scaled = ScaledTask.of(floor_task(np.random.default_rng(6), steps=5))
    closed = np.argwhere(scaled.low > scaled.high)
    assert len(closed)
    modes = np.full((5, 1), int(closed[0, 1]))
    assert least_smoothing(scaled, modes, np.full_like(modes, -1))[0] == np.inf
