import numpy as np
import pytest

from expert.geometry.pose import rotation, to_world
from expert.pushing.impulses import ANGLE, X, run, substep
from expert.pushing.refine import composed
from tests.support.pushing import TEE, square_model, tee_model

gymnasium = pytest.importorskip("gymnasium")
pytest.importorskip("gym_pusht")
WALL_REACH = 130.0
"""A T whose centre of gravity is this far from the walls touches none."""


def world(damping=None):
    """The environment itself, and its state as the model has it."""
    import gym_pusht  # noqa: F401  (registers the environment)

    environment = gymnasium.make("gym_pusht/PushT-v0", obs_type="state", damping=damping)
    return environment, environment.unwrapped


def state_of(bare):
    centre = bare.block.local_to_world(bare.block.center_of_gravity)
    return np.array([*bare.agent.position, *centre, bare.block.angle])


@pytest.mark.parametrize("damping", [None, 0.5**100])
def test_the_model_is_the_engine(damping):
    """Random commands across the block: finger and block agree to 10^-5 pixels, step after step, while no wall is near."""
    environment, bare = world(damping)
    model = tee_model()
    law = model.law._replace(kept=0.0 if damping is None else damping**0.01)
    rng = np.random.default_rng(0)
    touched = 0
    for episode in range(8):
        start = [256, 480, 256, 256, rng.uniform(-3, 3)]
        environment.reset(seed=episode, options={"reset_to_state": start})
        state = np.zeros(13)
        state[:2], state[X : ANGLE + 1] = np.split(state_of(bare), [2])
        for _ in range(30):
            command = rng.uniform(150, 360, 2)
            before = bare.block.angle
            bare.step(command)
            run(law, state, command[None], 10)
            now = state_of(bare)
            if np.abs(now[2:4] - 256).max() > 256 - WALL_REACH:
                break
            touched += before != bare.block.angle
            assert np.concatenate([state[:2], state[X : ANGLE + 1]]) == pytest.approx(now, abs=1e-5)
    assert touched > 20


def test_a_push_is_the_same_in_the_body_frame_wherever_the_block_is():
    model = tee_model()
    pose = np.array([310.0, 190.0, 2.3])
    start, direction = np.array([20.0, -70.0]), np.array([0.0, 1.0])
    (shift,), (finger,) = model.outcomes(start[None], direction[None], np.array([100.0]))
    state = np.zeros(13)
    state[:2], state[X : ANGLE + 1] = to_world(pose, start[None])[0], pose
    weights = model.drive.commands(
        int(model.steps(np.array([100.0]))[0]), np.zeros(2), np.zeros(2), np.ones(2), {}
    )
    commands = state[:2] + 100 * weights * (rotation(pose[2]) @ direction)
    run(model.law, state, commands, model.drive.substeps)
    after = composed(pose[None], shift[None])[0]
    assert state[X : ANGLE + 1] == pytest.approx(after, abs=1e-8)
    assert state[:2] == pytest.approx(to_world(after, finger[None])[0], abs=1e-8)


def test_a_push_through_the_centre_of_gravity_does_not_turn():
    (shift,), _ = square_model().outcomes(np.array([[0.0, -51.0]]), np.array([[0.0, 1.0]]), np.array([60.0]))
    assert shift[[0, 2]] == pytest.approx([0, 0], abs=1e-12)
    assert 45 < shift[1] < 60


def test_contact_gives_the_least_impulse_that_stops_the_approach():
    """After one contact substep the touched point recedes as fast as the finger comes; force along the normal only."""
    model = tee_model()
    law = model.law._replace(bias=0.0)
    state = np.zeros(13)
    state[:4] = 30.0, -59.9, 0.0, 200.0  # below the bar, moving up
    substep(law, state, 30.0, 100.0)
    vx, vy, spin = state[7:10]
    assert vx == pytest.approx(0)
    assert vy + spin * 30.0 == pytest.approx(state[3])
    assert spin == pytest.approx(vy * 30.0 / 3000.0)


def test_a_finger_that_leaves_does_not_pull():
    model = tee_model()
    state = np.zeros(13)
    state[:4] = 30.0, -60.05, 0.0, -200.0
    substep(model.law, state, 30.0, -200.0)
    assert state[7:10] == pytest.approx([0, 0, 0])


def test_the_T_is_that_of_the_environment():
    _, bare = world()
    bare.reset(seed=0)
    assert tee_model().block.gyration == bare.block.moment / bare.block.mass
    assert tuple(tee_model().block.centre) == tuple(bare.block.center_of_gravity)
    ours = {tuple(map(float, v)) for piece in TEE.pieces for v in piece}
    assert ours == {tuple(v) for shape in bare._block_shapes for v in shape.get_vertices()}
