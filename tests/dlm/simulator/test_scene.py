"""Scenes as padded arrays."""

import numpy as np
import pytest
import torch

from dlm.simulator import Scene, SceneBatch
from dlm.simulator.gradient import rollout
from dlm.simulator.scene import PUSHING
from tests.support.scenes import MASS, WEIGHT, T, batch_of, lift, push, random_case, transverse_push


def test_batches_of_mixed_sizes_pad_without_effect():
    cases = [push(), lift()] + [random_case(np.random.default_rng(k)) for k in range(3)]
    batch, positions, forces = batch_of(cases)
    part = batch[[3, 0]]
    assert len(part) == 2
    whole = rollout(batch, positions, forces)
    assert torch.equal(rollout(part, positions[[3, 0]], forces[[3, 0]]), whole[[3, 0]])


def test_springs_are_as_stiff_as_the_object_is_heavy_unless_given():
    case = push()
    assert case.scene.stiffness == pytest.approx(1e5 * MASS)
    stated = Scene(
        body=case.scene.body,
        environment=case.scene.environment,
        trajectory=case.scene.trajectory,
        friction=0.5,
        stiffness=7.0,
    )
    assert SceneBatch.of([stated]).arrays.stiffness.tolist() == [7.0]


@pytest.mark.parametrize("case", [push(), transverse_push()], ids=["sagittal", "transverse"])
def test_a_finger_is_loaded_above_a_share_of_the_weight_in_either_plane(case):
    batch, forces = SceneBatch.of([case.scene]), np.zeros((1, T, 4, 2))
    limit = PUSHING * WEIGHT / np.sqrt(2)
    forces[0, :, 0], forces[0, :, 1], forces[0, :, 2] = 1.001 * limit, -0.999 * limit, np.nan
    assert (batch.loaded(forces) == [True, False, False, False]).all()
