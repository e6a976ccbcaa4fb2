import numpy as np
import pytest

from dlm.control import pusht
from dlm.control.fit import fit_disc, fit_pose
from dlm.control.look import BLOCK_BIAS, find_agent, find_block, frame_of, near, stage
from dlm.control.picture import empty_scene, paint, paint_disc
from dlm.control.worlds import PushT, Spoiler
from expert.errors import InvalidProblem
from expert.geometry.pose import wrapped

pytest.importorskip("gym_pusht")
EPISODES = 60


@pytest.fixture(scope="module")
def scene():
    planner = pusht.pusht_planner(60.0)
    edges = planner.model.edges
    return stage(edges, empty_scene(edges, planner.goal.pose), 15.0), planner.goal.centroid


@pytest.fixture(scope="module")
def sights():
    """First frames of episodes with the true agent and block, for the tests alone to know."""
    world = PushT()
    found = []
    for seed in range(EPISODES):
        frame = world.reset(seed)["pixels"]
        bare = world.environment.unwrapped
        pose = pusht.about_centre([*bare.block.position, bare.block.angle])
        found.append((frame, np.array(bare.agent.position), pose))
    return found


def test_empty_scene_is_the_environments_but_for_a_few_samples(scene, sights):
    at, _ = scene
    differing = []
    for image, agent, pose in sights[:10]:
        far = (np.hypot(*(at.places - agent).T) > 25).T & (np.hypot(*(at.places - pose[:2]).T) > 110).T
        differing.append(np.abs(at.empty - image)[far].max(axis=1) > 40)
    assert np.concatenate(differing).mean() < 0.04


def test_block_and_agent_are_found_from_nothing(scene, sights):
    """Within 1.5 pixels and 1.5 degrees, without a half-turn error; no bias above a tenth."""
    at, centroid = scene
    errors, agents = [], []
    for image, agent, pose in sights:
        frame = frame_of(image)
        seen = find_agent(at, frame)
        found, _, _ = find_block(at, frame, centroid, seen)
        errors.append([*(found - pose)[:2], np.rad2deg(wrapped(found[2] - pose[2]))])
        if seen is not None and np.hypot(*(agent - pose[:2])) > 120:
            agents.append(seen - agent)
    errors, agents = np.array(errors), np.array(agents)
    assert np.abs(errors).max() < 1.5
    assert np.abs(np.mean(errors, axis=0)).max() < 0.15
    assert len(agents) > 20
    assert np.abs(agents).max() < 1
    assert np.abs(agents.mean(axis=0)).max() < 0.15


@pytest.mark.parametrize(
    "spoiler", [Spoiler(noise=25), Spoiler(jpeg=60), Spoiler(light=0.8)], ids=["noise", "jpeg", "light"]
)
def test_a_worse_camera_costs_little(scene, sights, spoiler):
    at, centroid = scene
    rng = np.random.default_rng(0)
    for image, agent, pose in sights[:20]:
        frame = frame_of(spoiler(image, rng))
        found, _, _ = find_block(at, frame, centroid, agent)
        assert np.abs((found - pose)[:2]).max() < 2.5
        assert abs(wrapped(found[2] - pose[2])) < np.deg2rad(2.5)


def test_fit_recovers_the_pose_that_painted_the_picture(scene):
    at, _ = scene
    true = np.array([200.0, 300.0, 1.1])
    frame = frame_of(np.full((96, 96, 3), 255, np.uint8))
    pixels = near(at, frame, true[:2], 120.0, None)
    paint(at.edges, 1, true, pixels, 4.0, pixels.seen)
    start = true + [5.0, -4.0, 0.1]
    pose, error = fit_pose(at.edges, 1, start, pixels, 4.0, 20, start, np.zeros(3))
    assert pose == pytest.approx(true, abs=0.02)
    assert error < 1


def test_fit_of_the_disc_recovers_its_centre(scene):
    at, _ = scene
    pixels = near(at, frame_of(np.full((96, 96, 3), 255, np.uint8)), np.array([150.0, 150.0]), 50.0, None)
    paint_disc(15.0, np.array([152.0, 147.0]), pixels, 4.0, pixels.seen)
    assert fit_disc(15.0, np.array([149.0, 150.0]), pixels, 4.0, 15) == pytest.approx([152, 147], abs=0.02)


@pytest.mark.parametrize(
    ("frame", "complaint"),
    [
        (np.zeros((96, 96), np.uint8), "shape"),
        (np.zeros((96, 96, 3)), "float64"),
        (np.zeros((96, 96, 3), np.uint8), "white ground"),
        (None, "uint8"),
    ],
)
def test_bad_frames_are_refused_in_one_line(frame, complaint):
    with pytest.raises(InvalidProblem, match=complaint) as caught:
        frame_of(frame)
    assert "\n" not in str(caught.value)


def test_a_frame_without_a_block_is_refused(scene):
    at, centroid = scene
    with pytest.raises(InvalidProblem, match="block in view"):
        find_block(at, frame_of(np.full((96, 96, 3), 255, np.uint8)), centroid, None)


def test_bias_is_smaller_than_a_pixel():
    assert np.abs(BLOCK_BIAS).max() < 1
