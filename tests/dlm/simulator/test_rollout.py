"""Batches: as good as single runs, untouched by bad neighbours, safe for any finite scene."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from dlm.simulator import Scene, SceneBatch, SimulatorSettings, replay
from dlm.simulator.gradient import rollout, rollout_with_status
from expert.errors import InvalidProblem
from expert.geometry.pose import to_world
from expert.world.shape import Body
from tests.support.scenes import T, batch_of, lift, push, random_case


def test_a_batch_equals_its_single_runs_bit_for_bit():
    rng = np.random.default_rng(0)
    cases = [random_case(rng) for _ in range(12)] + [push(), lift()]
    batch, positions, forces = batch_of(cases)
    together = rollout(batch, positions, forces)
    gradients = torch.autograd.grad(together.sum(), (positions, forces))
    for k, case in enumerate(cases):
        one, p, f = batch_of([case])
        alone = rollout(one, p, f)
        assert torch.equal(alone[0], together[k])
        for ours, theirs in zip(torch.autograd.grad(alone.sum(), (p, f)), gradients, strict=True):
            assert torch.equal(ours[0], theirs[k])
        np.testing.assert_array_equal(
            replay(case.scene, case.positions, case.forces).poses, together[k].detach()
        )


def test_rollouts_are_deterministic():
    cases = [random_case(np.random.default_rng(3)) for _ in range(5)]
    batch, positions, forces = batch_of(cases)
    assert torch.equal(rollout(batch, positions, forces), rollout(batch, positions, forces))


@pytest.mark.parametrize("gradient", ["implicit", "finite_difference"])
def test_nan_in_one_item_leaves_the_others_alone(gradient):
    cases = [push(), lift(), push(0.02)]
    batch, positions, forces = batch_of(cases)
    chosen = SimulatorSettings(gradient=gradient)
    clean = rollout(batch, positions, forces, chosen)
    expected = torch.autograd.grad(clean.sum(), positions)[0]
    broken = positions.detach().clone()
    broken[1, 2, 0, 0] = torch.nan
    broken.requires_grad_()
    poses, ok = rollout_with_status(batch, broken, forces, chosen)
    got = torch.autograd.grad(poses.sum(), broken)[0]
    assert ok.tolist() == [True, False, True]
    assert torch.isfinite(poses).all()
    assert torch.isfinite(got).all()
    assert torch.equal(poses[::2], clean[::2])
    assert torch.equal(got[::2], expected[::2])
    assert not got[1].any()


def test_a_start_offset_moves_the_object_and_not_the_fingers():
    case = lift()
    batch, positions, forces = batch_of([case])
    start = batch.desired[:, 0] + [0, 5e-4, 0]
    poses = rollout(batch, positions, forces, start=start)
    np.testing.assert_array_equal(poses[0, 0].detach(), start[0])
    assert poses[0, -1, 1].item() == pytest.approx(batch.desired[0, -1, 1] + 5e-4, abs=1e-4)


def test_contact_flags_follow_the_forces_unless_given():
    case = push()
    batch, positions, forces = batch_of([case])
    flags = np.zeros((1, T, 2), dtype=bool)
    flags[0, :, 0] = True
    assert torch.equal(rollout(batch, positions, forces), rollout(batch, positions, forces, contact=flags))
    idle = rollout(batch, positions, forces, contact=np.zeros_like(flags))
    parked = batch.desired[0, -1, 0] - SimulatorSettings().execution.parking  # follows at a distance
    assert idle[0, -1, 0].item() == pytest.approx(parked, abs=3e-4)


def test_mistaken_shapes_are_refused_by_name():
    batch, positions, forces = batch_of([push()])
    with pytest.raises(InvalidProblem, match="positions"):
        rollout(batch, positions[:, :3], forces[:, :3])
    with pytest.raises(InvalidProblem, match="forces"):
        rollout(batch, positions, forces[:, :, :1])
    with pytest.raises(InvalidProblem, match="contact"):
        rollout(batch, positions, forces, contact=np.zeros((1, T, 1), dtype=bool))
    with pytest.raises(InvalidProblem, match="start"):
        rollout(batch, positions, forces, start=np.zeros(3))
    with pytest.raises(InvalidProblem, match="scenes"):
        SceneBatch.of([])


@st.composite
def rough_cases(draw):
    """Any finite scene: extreme masses and friction, fingers inside, coincident, at vertices or far away."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    case = random_case(rng, plane=draw(st.sampled_from(["sagittal", "transverse"])))
    old = case.scene.body
    mass = 10.0 ** draw(st.floats(-6, 6))
    body = Body(
        vertices=old.vertices,
        mass=mass,
        inertia=old.inertia * mass / old.mass * 10.0 ** draw(st.floats(-3, 3)),
    )
    friction = draw(st.sampled_from([0.0, 1e-9, 0.5, 10.0, 1e6]))
    s = Scene(
        body=body,
        environment=case.scene.environment,
        trajectory=case.scene.trajectory,
        friction=friction,
        stiffness=10.0 ** draw(st.floats(-2, 10)),
    )
    positions, forces = case.positions.copy(), case.forces * 10.0 ** draw(st.floats(-3, 6))
    place = draw(st.sampled_from(["planned", "inside", "coincident", "vertex", "far", "everywhere"]))
    poses = s.trajectory.poses
    if place == "inside":
        positions[:] = poses[:, None, :2]
    elif place == "coincident":
        positions[:, 1] = positions[:, 0]
    elif place == "vertex":
        positions[:] = to_world(poses, body.vertices[:1])
    elif place == "far":
        positions += 1e6
    elif place == "everywhere":
        positions += rng.normal(0, 10.0 ** draw(st.floats(-4, 8)), positions.shape)
    return s, positions, forces


@settings(deadline=None, max_examples=150)
@given(rough_cases(), st.sampled_from([np.inf, 1250.0, 10.0]))
def test_no_finite_scene_gives_nan(case, kappa):
    s, positions, forces = case
    batch = SceneBatch.of([s])
    p, f = torch.tensor(positions[None], requires_grad=True), torch.tensor(forces[None], requires_grad=True)
    for gradient in ("implicit", "finite_difference"):
        poses, _ = rollout_with_status(batch, p, f, SimulatorSettings(kappa=kappa, gradient=gradient))
        assert torch.isfinite(poses).all()
        for g in torch.autograd.grad(poses.sum(), (p, f)):
            assert torch.isfinite(g).all()


def test_overflow_is_reported_and_held():
    """Springs so soft that the planned force asks for infinite commands, from the second knot on."""
    case = push()
    batch = SceneBatch.of([replace(case.scene, stiffness=1e-300)])
    forces = torch.tensor(case.forces[None]) * 1e20
    poses, ok = rollout_with_status(batch, torch.tensor(case.positions[None]), forces)
    assert torch.isfinite(poses).all()
    assert not ok.any()
    assert torch.equal(poses[0, -1], poses[0, -2])


def test_many_fingers_and_no_walls():
    case = random_case(np.random.default_rng(1), fingers=5, plane="transverse")
    r = replay(case.scene, case.positions, case.forces)
    assert r.ok
    assert r.fingers.shape == (81, 5, 2)
    assert len(np.unique(r.contacts.finger)) >= 3
    assert (r.contacts.wall == -1).all()
