import numpy as np
import pytest

from dlm.control import PushPolicy
from dlm.control.episodes import run_episode
from dlm.control.worlds import PushT

pytest.importorskip("gym_pusht")


@pytest.mark.parametrize("cog", [(20.0, 30.0), (-25.0, 60.0)])
def test_a_centre_of_gravity_elsewhere_is_found_in_the_episode(cog):
    """Up to 30 pixels off, untold: at least halfway found from pixels by the time the goal is reached."""
    policy = PushPolicy.for_pusht(observation="pixels")
    episode = run_episode(PushT("pixels", block_cog=cog), policy, 12)
    assert episode.success
    found, nominal = (p.model.block.centre for p in (policy.planner, policy.learner.first))
    assert np.hypot(*(found - cog)) < 0.5 * np.hypot(*(nominal - cog))


def test_a_block_that_slides_on_is_waited_for():
    policy = PushPolicy.for_pusht(observation="pixels")
    episode = run_episode(PushT("pixels", damping=0.9**100), policy, 12)
    assert episode.success
    assert policy.planner.model.block.kept == pytest.approx(0.9, abs=0.1)
    assert policy.planner.model.waits >= 3


def test_nothing_is_learnt_where_the_block_is_as_told():
    policy, world = PushPolicy.for_pusht(observation="pixels"), PushT("pixels")
    for seed in range(300, 306):
        assert run_episode(world, policy, seed).success
        assert policy.planner is policy.learner.first


def test_a_new_episode_forgets():
    policy = PushPolicy.for_pusht(observation="state")
    run_episode(PushT("state", block_cog=(-25.0, 60.0)), policy, 12)
    assert policy.planner is not policy.learner.first
    policy.reset()
    assert policy.planner is policy.learner.first
