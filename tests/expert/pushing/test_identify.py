from dataclasses import replace

import numpy as np
import pytest

from expert.geometry.pose import rotation, to_world
from expert.pushing.identify import Seen, identified, misfit
from expert.pushing.impulse_model import ImpulseModel
from expert.pushing.impulses import ANGLE, X, run
from tests.support.pushing import tee_model

NOMINAL = replace(tee_model(), reference=tee_model().origin)


def seen(model: ImpulseModel, start, direction, length, noise=0.0, seed=0) -> Seen:
    """A push of the true block, with the wait after it, as it is seen."""
    pose = np.array([250.0, 260.0, 0.4])
    position = to_world(pose, np.array([start]))[0]
    steps = int(model.steps(np.array([length]))[0]) + 4
    weights = np.concatenate([model.weights(steps - 4), np.ones(4)])
    commands = position + weights[:, None] * length * (rotation(pose[2]) @ direction)
    state = np.zeros(13)
    state[:2], state[X : ANGLE + 1] = position, model.centre_pose(pose)
    poses = []
    for command in commands:
        run(model.law, state, command[None], model.drive.substeps)
        poses.append(model.frame_pose(state[X : ANGLE + 1]))
    blur = noise * np.random.default_rng(seed).normal(size=(len(poses), 3)) * [1, 1, 0.01]
    return Seen(pose, position, np.zeros(2), commands, np.array(poses) + blur)


PUSHES = [
    ([40.0, -66.0], [0.0, 1.0], 90.0),
    ([-80.0, -30.0], [1.0, 0.0], 80.0),
    ([36.0, 50.0], [-1.0, 0.0], 70.0),
]


@pytest.mark.parametrize("kept", [0.0, 0.5, 0.97])
def test_what_the_block_is_like_follows_from_three_pushes(kept):
    block = replace(NOMINAL.block, centre=np.array([-14.0, 62.0]), gyration=4300.0, kept=kept)
    true = replace(NOMINAL, block=block)
    pushes = [seen(true, *push) for push in PUSHES]
    assert max(misfit(NOMINAL, push) for push in pushes) > 5
    found = identified(NOMINAL, pushes, NOMINAL.block)
    assert found.block.centre == pytest.approx(block.centre, abs=0.3)  # the first guess pulls a little
    assert found.block.gyration == pytest.approx(block.gyration, rel=0.01)
    assert found.block.kept == pytest.approx(kept, abs=0.01)
    assert max(misfit(found, push) for push in pushes) < 0.3


def test_noise_of_pixels_costs_pixels():
    block = replace(NOMINAL.block, centre=np.array([20.0, 40.0]), gyration=2400.0)
    true = replace(NOMINAL, block=block)
    pushes = [seen(true, *push, noise=0.3, seed=k) for k, push in enumerate(PUSHES)]
    found = identified(NOMINAL, pushes, NOMINAL.block)
    assert found.block.centre == pytest.approx(block.centre, abs=2)
    assert found.block.gyration == pytest.approx(block.gyration, rel=0.05)


def test_pushes_that_say_nothing_leave_the_first_guess():
    idle = seen(NOMINAL, [150.0, 0.0], [1.0, 0.0], 50.0)  # away from the block
    assert np.ptp(idle.poses, axis=0) == pytest.approx([0, 0, 0])
    found = identified(NOMINAL, [idle], NOMINAL.block).block
    assert found.centre == pytest.approx(NOMINAL.block.centre, abs=1e-6)
    assert found.gyration == pytest.approx(NOMINAL.block.gyration)


def test_poses_of_the_centre_and_of_the_frame_are_inverse():
    model = replace(NOMINAL, block=replace(NOMINAL.block, centre=np.array([5.0, 70.0])))
    pose = np.array([12.0, -7.0, 2.1])
    assert model.frame_pose(model.centre_pose(pose)) == pytest.approx(pose)
    assert model.centre_pose(pose)[:2] == pytest.approx(to_world(pose, np.array([[5.0, 25.0]]))[0])


def test_a_table_in_another_frame_tells_the_same_motion():
    """Outcomes with the frame moved off the centre of gravity are those about the centre, seen from there."""
    model = replace(NOMINAL, block=replace(NOMINAL.block, centre=np.array([10.0, 60.0])))
    plain = replace(model, reference=None)
    start, direction, length = np.array([[20.0, -70.0]]), np.array([[0.0, 1.0]]), np.array([100.0])
    shifts, fingers = model.outcomes(start, direction, length)
    shifts_c, fingers_c = plain.outcomes(start - model.offset, direction, length)
    assert fingers == pytest.approx(fingers_c + model.offset)
    centre = np.concatenate([model.offset + shifts_c[0, :2], shifts_c[0, 2:]])
    assert model.frame_pose(centre) == pytest.approx(shifts[0])
