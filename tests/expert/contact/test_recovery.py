"""From a mixed-integer model's variables to a plan: intervals, cleaned weights, torque restored to the last digits."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from expert.contact import solve as solve_exactly
from expert.contact.recovery import Found, balanced, intervals, plan_of, pushing
from expert.contact.scaled import ScaledTask
from expert.contact.thesis import point_of
from expert.contact.thesis_blocks import Variables
from expert.files import read_problem
from expert.problems.contact import FREE, ContactTask
from tests.support.exact_points import assign

DATA = Path(__file__).parents[2] / "data" / "contact"


def test_contact_intervals_are_counted_finger_by_finger() -> None:
    modes = np.array([[0, FREE], [0, 2], [FREE, 2], [1, FREE], [1, 2]])
    np.testing.assert_array_equal(intervals(modes).T, [[0, 0, FREE, 1, 1], [FREE, 2, 2, FREE, 3]])
    np.testing.assert_array_equal(pushing(modes).T, [[1, 0, 0, 1, 1], [0, 1, 0, 0, 1]])


def test_a_wrench_off_by_a_solver_s_tolerance_is_balanced_again() -> None:
    task = read_problem(DATA / "sq_pivot2.json").task
    s = ScaledTask.of(task)
    x = Variables.of(s, task.fingers.count, segments=1)
    assign(x, task, s, solve_exactly(task))
    found = point_of(x)
    rng = np.random.default_rng(0)
    noise = {
        name: 1e-7 * rng.normal(size=getattr(found, name).shape) for name in ("rho", "alpha", "reactions")
    }
    noisy = replace(found, **{name: getattr(found, name) + noise[name] for name in noise})
    assert residual(task, s, noisy) > 1e-8
    assert residual(task, s, balanced(s, noisy, task.fingers.facet_margin)) < 1e-12


def residual(task: ContactTask, s: ScaledTask, found: Found) -> float:
    return plan_of(task, s, found, status="feasible", bound=0.0, seconds=0.0, nodes=0, reason="").residual


def test_an_exact_plan_survives_the_way_through_the_model_s_variables() -> None:
    task = read_problem(DATA / "sq_lift2.json").task
    s, plan = ScaledTask.of(task), solve_exactly(task)
    x = Variables.of(s, task.fingers.count, segments=1)
    assign(x, task, s, plan)
    again = plan_of(task, s, point_of(x), status="feasible", bound=0.0, seconds=0.0, nodes=0, reason="")
    np.testing.assert_allclose(again.positions, plan.positions, atol=1e-9)
    np.testing.assert_allclose(again.forces, plan.forces, atol=1e-9)
    assert abs(again.objective - plan.objective) <= 1e-9 * plan.objective
