import numpy as np
import pytest

from dlm.control import PushPolicy, pusht
from dlm.control.episodes import run_episode
from dlm.control.worlds import Outcome, PushT, Spoiler
from expert.errors import InvalidProblem

pytest.importorskip("gym_pusht")


class OnlyPixels:
    """A world that hides everything from whoever holds it: frames and the word of success come out, commands go in."""

    def __init__(self, inner):
        self.__reset, self.__step = inner.reset, inner.step

    def __getattr__(self, name):
        raise AssertionError(f"the policy reached for {name}")

    def reset(self, seed):
        return {"pixels": self.__reset(seed)["pixels"].copy()}

    def step(self, command):
        outcome = self.__step(np.array(command))
        return Outcome({"pixels": outcome.observation["pixels"].copy()}, outcome.success, np.nan)


def test_a_dozen_episodes_from_pixels_alone():
    """Nothing but frames goes in, and nothing is known of the environment: all succeed, half of them within 30 steps."""
    policy, world = PushPolicy.for_pusht(observation="pixels"), OnlyPixels(PushT("pixels"))
    episodes = [run_episode(world, policy, 700 + k) for k in range(12)]
    assert all(e.success for e in episodes)
    assert np.median([e.steps for e in episodes]) <= 30


def test_a_dozen_episodes_from_the_state():
    policy, world = PushPolicy.for_pusht(observation="state"), PushT("state")
    episodes = [run_episode(world, policy, 700 + k) for k in range(12)]
    assert all(e.success for e in episodes)
    assert np.median([e.steps for e in episodes]) <= 30


def test_perception_does_not_import_the_environment():
    """The policy's modules know of gym-pusht what its documentation states, not its code."""
    import subprocess
    import sys

    code = "import sys, dlm.control; print('gym_pusht' in sys.modules, 'gymnasium' in sys.modules, 'pymunk' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False"] * 3


def test_the_state_policy_predicts_the_world_exactly():
    """Where no wall is near, the T ends where the first plan said, to a hundredth of a pixel."""
    world, policy = PushT("state"), PushPolicy.for_pusht(observation="state")
    checked = 0
    for seed in range(6):
        observation = world.reset(seed)
        policy.reset()
        policy.select_action(observation)
        belief = policy.belief
        plan = policy.planner.plan(belief.pose, belief.position, belief.velocity, policy.tolerance)
        world.reset(seed)
        for command in plan.commands:
            outcome = world.step(command)
        pose = pusht.about_centre(outcome.observation["state"][2:])
        if np.abs(np.array([belief.pose, plan.expected])[:, :2] - 256).max() < 126:
            checked += 1
            assert pose[:2] == pytest.approx(plan.expected[:2], abs=0.01)
    assert checked >= 2


def test_the_same_frames_give_the_same_actions():
    world, policy = PushT("pixels"), PushPolicy.for_pusht()

    def actions():
        observation = world.reset(3)
        policy.reset()
        found = []
        for _ in range(8):
            found.append(policy.select_action(observation))
            observation = world.step(found[-1]).observation
        return np.array(found)

    first = actions()
    assert first.dtype == np.float32
    assert first.shape == (8, 2)
    assert (first == actions()).all()


def test_the_agent_may_hide_under_the_block():
    """Agent and block start in one place, where the block is painted over the agent or it over the block."""
    world, policy = PushT("pixels"), PushPolicy.for_pusht()
    for angle in (0.3, 2.0):
        observation = world.environment.reset(
            seed=1, options={"reset_to_state": [250, 262, 250, 250, angle]}
        )[0]
        policy.reset()
        success, steps = False, 0
        while not success and steps < 100:
            observation, success, _ = world.step(policy.select_action({"pixels": observation}))
            observation, steps = observation["pixels"], steps + 1
        assert success


def test_own_stop_is_right():
    world, policy = PushT("pixels"), PushPolicy.for_pusht()
    episodes = [run_episode(world, policy, 900 + k, stop="own") for k in range(8)]
    assert all(e.stopped for e in episodes)
    assert all(e.success for e in episodes)


def test_coverage_is_the_environments():
    world = PushT("state")
    for seed in range(3):
        state = [256, 480, 240 + 5 * seed, 250, 0.7 + 0.1 * seed]
        world.environment.reset(seed=seed, options={"reset_to_state": state})
        bare = world.environment.unwrapped
        pose = pusht.about_centre([*bare.block.position, bare.block.angle])
        assert pusht.coverage(pose) == pytest.approx(bare._get_coverage(), abs=1e-6)


def test_bad_observations_are_one_line():
    with pytest.raises(InvalidProblem, match="state"):
        PushPolicy.for_pusht(observation="state").select_action({"state": np.zeros(4)})
    with pytest.raises(InvalidProblem, match="pixels"):
        PushPolicy.for_pusht().select_action({"image": 1})
    with pytest.raises(InvalidProblem, match="observation"):
        PushPolicy.for_pusht(observation="sound")
    with pytest.raises(InvalidProblem, match="jpeg"):
        Spoiler(jpeg=0)
