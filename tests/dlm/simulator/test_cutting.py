"""Steps are cut into parts where the object moves too much in one: hard squeezes, impacts, tumbling."""

import numpy as np
import pytest
import shapely
import torch

from dlm.metrics import within
from dlm.simulator import Replay, Scene, SceneBatch, SimulatorSettings, replay
from dlm.simulator.gradient import rollout
from expert.geometry.pose import to_world
from expert.world.environment import Environment
from expert.world.motion import Trajectory
from expert.world.shape import Body
from expert.world.walls import HalfPlane
from tests.support.scenes import batch_of, lift, random_case
from tests.support.steps import driven

MASS, START = 0.5788, np.array([-0.0056942, 0.047813, 0.13688])
BOX = np.array([[0, 0], [0.12, 0], [0.12, 0.08], [0, 0.08]])


def squeezed() -> tuple[Scene, Replay]:
    """Two smooth fingers close on a box at an angle, with springs that would crush it."""
    walls = (
        HalfPlane(point=np.zeros(2), normal=np.array([0.0, 1.0]), friction=1.0),
        HalfPlane(point=np.array([0.2, 0.0]), normal=np.array([-1.0, 0.0]), friction=1.0),
    )
    scene = Scene(
        body=Body.uniform(BOX, MASS)[0],
        environment=Environment(walls=walls),
        trajectory=Trajectory.of(np.tile(START, (3, 1)), 0.1, "rest"),
        friction=0.0,
    )
    first = np.array([[-0.0761055, 0.0598576], [0.0605730, 0.0410095]])
    last = np.array([[0.0209047, 0.0741638], [-0.0268576, 0.0974279]])
    share = np.linspace(0, 1, 81)[:, None, None]
    commands = (1 - share) * first + share * last
    return scene, driven(scene, START, commands, commands[0])


def test_a_hard_squeeze_penetrates_nothing_and_gains_no_more_than_the_fingers_give():
    scene, record = squeezed()
    deepest = 0.0
    for pose, fingers in zip(record.substep_poses, record.fingers, strict=True):
        corners = to_world(pose, scene.body.vertices)
        outline = shapely.Polygon(corners)
        inside = [shapely.Point(f) for f in fingers if outline.contains(shapely.Point(f))]
        depths = [outline.exterior.distance(f) for f in inside]
        deepest = max(deepest, -corners[:, 1].min(), corners[:, 0].max() - 0.2, *depths)
    assert deepest < 1e-4
    gained = record.energy[-1] - record.energy[0]
    assert gained > 0.1 * MASS * 9.81 * 0.1  # it is squeezed out
    assert gained <= record.work.sum() * (1 + 1e-6)


@pytest.mark.slow
def test_random_scenes_end_as_with_an_eighth_of_the_step():
    rng = np.random.default_rng(20_261)
    batch, p, f = batch_of([random_case(rng) for _ in range(200)])
    coarse, fine, uncut = (
        rollout(batch, p, f, SimulatorSettings(**settings)).detach().numpy()
        for settings in ({}, {"substeps": 160}, {"step_error": np.inf})
    )
    assert within(coarse, fine, mm=0.5, deg=1.0).mean() >= 0.9
    assert within(uncut, fine, mm=0.5, deg=1.0).mean() < 0.85  # so that it is the cutting that does it


def test_ordinary_steps_are_left_whole():
    case = lift()
    whole = replay(case.scene, case.positions, case.forces, SimulatorSettings(step_error=np.inf))
    np.testing.assert_array_equal(replay(case.scene, case.positions, case.forces).poses, whole.poses)


def test_gradients_go_through_the_parts_of_a_step():
    """An L-shape that a smooth finger flicks against floor and wall."""
    vertices = np.array([[0, 0], [0.1, 0], [0.1, 0.03], [0.03, 0.03], [0.03, 0.08], [0, 0.08]])
    walls = (
        HalfPlane(point=np.zeros(2), normal=np.array([0.0, 1.0]), friction=1.5),
        HalfPlane(point=np.array([0.2, 0.0]), normal=np.array([-1.0, 0.0]), friction=1.5),
    )
    scene = Scene(
        body=Body.uniform(vertices, 0.2041)[0],
        environment=Environment(walls=walls),
        trajectory=Trajectory.of(np.tile([0.0793685, 0.0543261, -2.0913975], (4, 1)), 0.2, "rest"),
        friction=0.0,
    )
    path = np.array([[0.0866858, 0.0553804], *[[0.1402663, 0.0370082]] * 3])[:, None]
    gradients = []
    for settings in ({"gradient": "implicit"}, {"gradient": "finite_difference", "difference_step": 1e-8}):
        p = torch.tensor(path[None], requires_grad=True)
        batch, flags = SceneBatch.of([scene]), np.ones((1, 4, 1), dtype=bool)
        poses = rollout(batch, p, torch.zeros_like(p), SimulatorSettings(**settings), contact=flags)
        gradients.append(torch.autograd.grad((poses * torch.tensor([1, 2, 0.03])).sum(), p)[0].numpy())
    assert np.abs(gradients[0] - gradients[1]).max() < 1e-4 * np.abs(gradients[0]).max()
