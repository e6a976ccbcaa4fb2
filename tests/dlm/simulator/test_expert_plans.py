"""Expert plans reach their goals here and in MuJoCo; each layer of the execution earns its place."""

import numpy as np
import pytest
import torch

from dlm.metrics import object_trajectory_loss, within
from dlm.simulator import Execution, SceneBatch, SimulatorSettings
from dlm.simulator.gradient import rollout
from dlm.simulator.mujoco import replay_in_mujoco
from tests.benchmarks.simulator import descend
from tests.support.expert_plans import planned_tasks, transverse_tasks


@pytest.fixture(scope="module")
def plans():
    few, _ = planned_tasks(36, (4, 6), 7)
    many, _ = planned_tasks(12, (12, 12), 7)
    return few + many


def outcomes(plans, settings=None):
    batch = SceneBatch.of([p.task for p in plans])
    positions, forces = (
        torch.tensor(np.array([getattr(p.plan, k) for p in plans])) for k in ("positions", "forces")
    )
    return rollout(batch, positions, forces, settings).numpy(), batch.desired


def test_plans_follow_the_desired_motion(plans):
    got, desired = outcomes(plans)
    assert within(got, desired).mean() >= 0.93
    assert np.median(object_trajectory_loss(got, desired)) <= 1e-4


def test_compensation_and_material_points_matter(plans):
    full = object_trajectory_loss(*outcomes(plans)).mean()
    for execution in (Execution(compensation=False), Execution(material_point=False)):
        worse = object_trajectory_loss(*outcomes(plans, SimulatorSettings(execution=execution)))
        assert worse.mean() > 3 * full


def test_mujoco_agrees(plans):
    pytest.importorskip("mujoco")
    some = plans[:12]
    ours, _ = outcomes(some)
    theirs = np.array([replay_in_mujoco(p.task, p.plan.positions, p.plan.forces).poses for p in some])
    assert within(ours, theirs, mm=0.5, deg=1).mean() >= 0.9


def test_plans_on_a_table_follow_the_desired_motion():
    table, _ = transverse_tasks(3, 7)
    got, desired = outcomes(table)
    assert within(got, desired, mm=0.2, deg=0.2).all()


def test_annealed_smoothing_finds_a_push_where_the_rigid_gradient_is_zero():
    before, after, _ = descend(annealed=True)
    _, stuck, gradient = descend(annealed=False)
    assert gradient == 0
    assert stuck == before
    assert after <= 0.4 * before
