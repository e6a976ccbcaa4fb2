"""Both gradients against differences that share no code with them, and against each other."""

import numpy as np
import pytest
import torch

from dlm.simulator import Execution, SceneBatch, SimulatorSettings, replay
from dlm.simulator.gradient import rollout
from tests.support.scenes import MASS, T, batch_of, lift, push, random_case, transverse_push

STIFFNESS = 1e5 * MASS
"""Forces over stiffness are lengths, like positions."""


def weights(n, seed=0):
    adjoint = np.random.default_rng(seed).normal(size=(n, T, 3))
    adjoint[..., 2] *= 0.03
    return torch.tensor(adjoint)


def gradient(cases, **settings):
    """Of a random functional with respect to positions and force / stiffness, (B, entries)."""
    batch, p, f = batch_of(cases)
    loss = (rollout(batch, p, f, SimulatorSettings(**settings)) * weights(len(cases))).sum()
    d_p, d_f = torch.autograd.grad(loss, (p, f))
    return torch.cat([d_p.reshape(len(cases), -1), STIFFNESS * d_f.reshape(len(cases), -1)], 1).numpy()


def cosines(a, b):
    return (a * b).sum(1) / np.maximum(np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1), 1e-300)


@pytest.mark.parametrize("kappa", [np.inf, 1250.0, 100.0])
@pytest.mark.parametrize("plane", ["sagittal", "transverse"])
def test_implicit_equals_central_differences_of_a_tiny_step(plane, kappa):
    rng = np.random.default_rng(1)
    cases = [random_case(rng, plane=plane) for _ in range(25)]
    step = 1e-9 if np.isinf(kappa) else 1e-10  # smoothed contacts curve strongly
    exact = gradient(cases, gradient="implicit", kappa=kappa)
    differences = gradient(cases, gradient="finite_difference", difference_step=step, kappa=kappa)
    felt = exact.any(axis=1)
    np.testing.assert_array_equal(felt, differences.any(axis=1))
    assert felt.sum() >= 20  # from the others the object falls away untouched
    exact, differences = exact[felt], differences[felt]
    cosine = cosines(exact, differences)
    assert np.median(cosine) > 1 - 1e-9
    assert np.quantile(cosine, 0.1) > 0.999
    assert np.median(np.linalg.norm(exact, axis=1) / np.linalg.norm(differences, axis=1)) == pytest.approx(
        1, abs=1e-6
    )


def test_finite_differences_equal_those_of_whole_replays():
    """The kernel restarts rollouts where commands first differ and skips fingers out of reach; replays do not."""
    rng = np.random.default_rng(2)
    step, uncut = 1e-5, SimulatorSettings(step_error=np.inf)  # replays would cut other steps after a change
    for case in (push(), random_case(rng), random_case(rng)):
        fast = gradient([case], gradient="finite_difference", difference_step=step, step_error=np.inf)[0]
        plan = np.stack([case.positions, case.forces / STIFFNESS])
        w = weights(1)[0].numpy()
        slow = np.zeros(plan.size)
        for k in range(plan.size):
            ends = []
            for sign in (1, -1):
                moved = plan.copy().reshape(-1)
                moved[k] += sign * step
                p, f = moved.reshape(plan.shape)
                flags = np.abs(case.forces).max(-1) > 0
                ends.append((replay(case.scene, p, f * STIFFNESS, uncut, contact=flags).poses * w).sum())
            slow[k] = (ends[0] - ends[1]) / (2 * step)
        np.testing.assert_allclose(fast, slow, atol=1e-6 * np.abs(slow).max())


@pytest.mark.parametrize("case", [push(), lift(), transverse_push()], ids=["push", "lift", "transverse"])
def test_gradcheck(case):
    batch, p, f = batch_of([case])
    chosen = SimulatorSettings(gradient="implicit", kappa=1250.0)
    flags = np.abs(case.forces[None]).max(-1) > 0

    def motion(positions, lead):
        return rollout(batch, positions, lead * STIFFNESS, chosen, contact=flags)

    lead = (f.detach() / STIFFNESS).requires_grad_()
    # Steps below the smallest kink, outputs of order one per metre: absolute tolerance well under one entry.
    assert torch.autograd.gradcheck(motion, (p, lead), eps=1e-9, atol=2e-4, rtol=1e-3)


def test_gradients_reach_forces_through_the_compensation_only():
    case = push()
    batch, p, f = batch_of([case])
    for compensation in (True, False):
        chosen = SimulatorSettings(gradient="implicit", execution=Execution(compensation=compensation))
        (d_f,) = torch.autograd.grad(rollout(batch, p, f, chosen).sum(), f)
        assert bool(d_f.any()) is compensation


def test_gradients_keep_the_callers_precision():
    case = push()
    batch = SceneBatch.of([case.scene])
    p = torch.tensor(case.positions[None], dtype=torch.float32, requires_grad=True)
    f = torch.tensor(case.forces[None], dtype=torch.float32, requires_grad=True)
    poses = rollout(batch, p, f)
    poses.sum().backward()
    assert poses.dtype == torch.float64
    assert p.grad.dtype == f.grad.dtype == torch.float32


def test_smoothing_gives_a_gradient_where_the_rigid_one_vanishes():
    """A finger that stays 3 mm off an object at rest: rigid contact knows nothing of it, smoothed contact does."""
    case = push(0.0)
    away = case.positions.copy()
    away[:, 0, 0] -= 0.003
    batch = SceneBatch.of([case.scene])
    flags = np.ones((1, T, 2), dtype=bool)
    size = {}
    for kappa in (np.inf, 100.0):
        p = torch.tensor(away[None], requires_grad=True)
        chosen = SimulatorSettings(gradient="implicit", kappa=kappa)
        x = rollout(batch, p, torch.zeros_like(p), chosen, contact=flags)[0, -1, 0]
        size[kappa] = torch.autograd.grad(x, p)[0].norm().item()
    assert size[np.inf] == 0
    assert size[100.0] > 1e-5


@pytest.mark.parametrize("gradient", ["implicit", "finite_difference"])
def test_descent_on_either_gradient_mends_a_bad_push(gradient):
    case = push()
    batch = SceneBatch.of([case.scene])
    goal = torch.tensor(batch.desired)
    p = torch.tensor(case.positions[None] - [0.004, 0], requires_grad=True)
    f = torch.tensor(case.forces[None])
    optimiser = torch.optim.Adam([p], lr=4e-4)
    losses = []
    for _ in range(30):
        optimiser.zero_grad()
        loss = (1e4 * (rollout(batch, p, f, SimulatorSettings(gradient=gradient)) - goal) ** 2).mean()
        loss.backward()
        optimiser.step()
        losses.append(loss.item())
    assert losses[-1] < 0.1 * losses[0]
