"""The convex program at a plan: exact there, correct to first order around it."""

import numpy as np
import pytest

from expert.contact import solve
from expert.contact.first_order import Program, curvature, first_order
from expert.contact.plan_at import forces_at
from expert.contact.scaled import ScaledTask
from expert.contact.sequence import Sequence, fixed, pushes, sequence_of
from expert.contact.steps import rays_per_end, step_program
from expert.problems.contact import Robustness
from tests.support.random_tasks import floor_task

ROBUST = Robustness(cone_fraction=0.7, support_inset=0.3, min_normal_force=0.04, min_interval=2)


@pytest.fixture(params=[1, 5])
def case(request: pytest.FixtureRequest) -> tuple[ScaledTask, Sequence, np.ndarray, np.ndarray]:
    """Scaled task, sequence, point and its ray weights, of a plan."""
    task = floor_task(np.random.default_rng(request.param), steps=5, robustness=ROBUST)
    plan, scaled = solve(task), ScaledTask.of(task)
    s = sequence_of(scaled, plan.modes)
    p = (plan.positions - scaled.origin) / scaled.size
    z = np.linalg.lstsq(s.map.reshape(-1, s.size), (p - s.offset).ravel(), rcond=None)[0]
    return scaled, s, z, forces_at(scaled, s, z).weights


def point(program: Program, z: np.ndarray, weights: np.ndarray) -> np.ndarray:
    used = [weights[t, : program.first[t + 1] - program.first[t]] for t in range(len(weights))]
    return np.concatenate([z, *used])


def torques(scaled: ScaledTask, s: Sequence, z: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """What the rays with these weights exert at z, (T,), and what is needed, subtracted."""
    balance = np.zeros(len(weights))
    for t in range(len(weights)):
        program = step_program(scaled, fixed(s, t, z))
        balance[t] = program.A[2] @ weights[t, : program.g.size] - program.b[2]
    return balance


def test_the_plan_satisfies_its_own_program(case: tuple) -> None:
    scaled, s, z, weights = case
    program = first_order(scaled, s, z, weights)
    v = point(program, z, weights)
    slack = program.A @ v - program.b
    np.testing.assert_allclose(slack[: program.equalities], 0, atol=1e-8)
    assert slack[program.equalities :].min() >= -1e-8
    assert np.linalg.eigvalsh(program.H).min() > 0


def test_torque_rows_are_the_torque_to_first_order(case: tuple) -> None:
    scaled, s, z, weights = case
    program, rng = first_order(scaled, s, z, weights), np.random.default_rng(0)
    step = np.zeros_like(z)
    step[: len(s.lo)] = rng.normal(size=len(s.lo))
    push = rng.uniform(0, 1, weights.shape)
    errors = []
    for h in (1e-3, 1e-4):
        moved = point(program, z + h * step, weights + h * push)
        linear = (program.A @ moved - program.b)[program.torque[program.torque >= 0]]
        exact = torques(scaled, s, z + h * step, weights + h * push)[program.torque >= 0]
        errors.append(np.abs(linear - exact).max())
    assert errors[0] > 0
    assert errors[1] < 0.02 * errors[0]


def test_curvature_is_the_second_derivative_of_the_torque_terms(case: tuple) -> None:
    scaled, s, z, weights = case
    program = first_order(scaled, s, z, weights)
    u = np.random.default_rng(1).normal(size=len(program.b))
    bent = curvature(scaled, s, program, u)
    np.testing.assert_array_equal(bent, bent.T)
    each, seen = rays_per_end(scaled), 0
    for t, row in enumerate(program.torque):
        for i, k in enumerate(pushes(s, t)):
            first = program.first[t] + each * i
            base = torques(scaled, s, z, weights)[t]
            there = z.copy()
            there[k] += 0.1
            more = weights.copy()
            more[t, each * i] += 1.0
            mixed = torques(scaled, s, there, more)[t] - torques(scaled, s, there, weights)[t]
            mixed -= torques(scaled, s, z, more)[t] - base
            assert bent[k, first] == pytest.approx(-u[row] * mixed / 0.1, rel=1e-6, abs=1e-9)
            seen += 1
    assert seen > 0
