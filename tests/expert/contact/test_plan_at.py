"""Forces at fixed places: exact torque, cones, and a refusal where nothing balances."""

import numpy as np
import pytest

from expert.contact import solve
from expert.contact.plan_at import RESIDUAL, forces_at, plan_at
from expert.contact.scaled import ScaledTask
from expert.contact.sequence import Sequence, sequence_of
from expert.errors import SolverFailed
from expert.problems.contact import ContactTask, Plan
from expert.verify.plan.check import check_plan
from tests.support.random_tasks import floor_task


def at(task: ContactTask, plan: Plan) -> tuple[ScaledTask, Sequence, np.ndarray]:
    """The plan's variables."""
    scaled = ScaledTask.of(task)
    s = sequence_of(scaled, plan.modes)
    p = (plan.positions - scaled.origin) / scaled.size
    z = np.linalg.lstsq(s.map.reshape(-1, s.size), (p - s.offset).ravel(), rcond=None)[0]
    return scaled, s, z


@pytest.mark.parametrize("seed", [1, 3, 5])
def test_a_plan_s_places_give_its_forces_again(seed: int) -> None:
    task = floor_task(np.random.default_rng(seed))
    plan = solve(task)
    again = plan_at(task, *at(task, plan), status="feasible")
    assert again.objective == pytest.approx(plan.objective, rel=1e-9)
    np.testing.assert_allclose(again.forces, plan.forces, atol=1e-8)
    assert again.residual <= RESIDUAL
    assert check_plan(task, again).verdict == "sound"


def test_other_places_cost_no_less() -> None:
    task = floor_task(np.random.default_rng(1))
    plan = solve(task, gap=1e-5)
    scaled, s, z = at(task, plan)
    rng = np.random.default_rng(0)
    for _ in range(20):
        other = z.copy()
        other[: len(s.lo)] = np.clip(z[: len(s.lo)] + rng.normal(0, 0.05, len(s.lo)), s.lo, s.hi)
        assert forces_at(scaled, s, other).cost >= plan.bound / task.weight**2 - 1e-9


def test_places_without_a_balance_are_refused() -> None:
    """Nobody pushes, but the motion needs it."""
    task = floor_task(np.random.default_rng(1))
    scaled = ScaledTask.of(task)
    nobody = sequence_of(scaled, np.full((task.steps, 2), -1))
    assert forces_at(scaled, nobody, nobody.reference).cost == np.inf
    with pytest.raises(SolverFailed, match="could not be computed again"):
        plan_at(task, scaled, nobody, nobody.reference, status="feasible")
