"""Commands as an affine function of the plan."""

import numpy as np
import pytest

from dlm.simulator import SceneBatch, SimulatorSettings
from dlm.simulator.commands import command, pull_back
from dlm.simulator.execution import plan_commands
from dlm.simulator.world import world_of
from tests.support.scenes import T, random_case


@pytest.mark.parametrize("seed", range(6))
def test_pull_back_is_the_transpose_of_the_derivative(seed):
    rng = np.random.default_rng(seed)
    case = random_case(rng)
    loaded = rng.random((T, 2)) < 0.6
    batch, numbers = SceneBatch.of([case.scene]), SimulatorSettings().numbers
    world, path = world_of(batch.arrays, 0, numbers), batch.desired[0]
    lifted = case.positions + 0.002 * rng.normal(size=case.positions.shape)

    def commands(positions, forces):
        table, out = plan_commands(world, path, positions, loaded, numbers), np.zeros((81, 2, 2))
        command(table, positions, forces, world.stiffness, out)
        return out

    dp, df = 1e-7 * rng.normal(size=lifted.shape), 1e-3 * rng.normal(size=lifted.shape)
    change = (commands(lifted + dp, case.forces + df) - commands(lifted - dp, case.forces - df)) / 2
    adjoint = rng.normal(size=change.shape)
    d_positions, d_forces = np.zeros_like(lifted), np.zeros_like(lifted)
    table = plan_commands(world, path, lifted, loaded, numbers)
    pull_back(table, adjoint, world.stiffness, d_positions, d_forces)
    assert (adjoint * change).sum() == pytest.approx(
        (d_positions * dp).sum() + (d_forces * df).sum(), rel=1e-5
    )
