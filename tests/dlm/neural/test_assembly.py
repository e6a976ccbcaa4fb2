from dataclasses import replace

import numpy as np
import pytest
import torch
from torch import Tensor

from datasets.motions import TaskSettings
from dlm.evaluation.outcomes import execute
from dlm.inverse_dynamics.layer import InverseDynamics
from dlm.inverse_dynamics.parameters import ParameterBatch
from dlm.neural.assembly import Margins, assemble, solve
from dlm.simulator import SimulatorSettings
from dlm.structured.classes import Schedules
from dlm.structured.features import Geometry
from dlm.structured.scorer import stack
from dlm.tasks import TaskBatch
from expert.problems.contact import FREE, Cost

SCHEDULES = Schedules()
SETTINGS = TaskSettings()


@pytest.fixture(scope="module")
def program() -> InverseDynamics:
    return InverseDynamics(backend="batched")


def labelled(tasks: TaskBatch) -> tuple[Geometry, np.ndarray, np.ndarray]:
    """True geometry and the expert's classes, and which finger of the plan is which of the class."""
    geometry = stack([(s.task.body.vertices, s.task.trajectory.poses) for s in tasks.samples])
    classes = np.array([SCHEDULES.class_of(s.plan.modes) for s in tasks.samples])
    modes = SCHEDULES.modes(classes)
    order = [
        [0, 1] if (m == s.plan.modes).all() else [1, 0] for m, s in zip(modes, tasks.samples, strict=True)
    ]
    assert all((m[:, o] == s.plan.modes).all() for m, o, s in zip(modes, order, tasks.samples, strict=True))
    return geometry, classes, np.array(order)


def assembled(tasks: TaskBatch, geometry: Geometry, classes: np.ndarray) -> ParameterBatch:
    push = [s.task.robustness.min_normal_force / s.task.weight for s in tasks.samples]
    assert len(set(np.round(push, 9))) == 1
    settings = replace(SETTINGS, least_push=push[0])
    return assemble(geometry, classes, SCHEDULES, settings, Margins.of(settings))


@pytest.mark.parametrize("name", ["poses", "wrench", "external_contact", "external_points", "external_cones"])
def test_what_the_motion_decides_is_as_the_expert_has_it(tasks: TaskBatch, name: str) -> None:
    geometry, classes, _ = labelled(tasks)
    got, wanted = (P.named()[name] for P in (assembled(tasks, geometry, classes), tasks.parameters))
    if name.startswith("external"):  # the expert lists them by vertex, we from the left
        rank = [
            P.external_points[..., 0].argsort(-1)
            for P in (assembled(tasks, geometry, classes), tasks.parameters)
        ]
        got, wanted = (
            x.gather(2, r.view(*r.shape, *[1] * (x.dim() - 3)).expand_as(x))
            for x, r in zip((got, wanted), rank, strict=True)
        )
    torch.testing.assert_close(got, wanted, atol=1e-9, rtol=1e-9)


@pytest.mark.parametrize("name", ["facets", "cones", "contact", "stick", "force_limits"])
def test_what_the_class_decides_is_as_the_expert_has_it(tasks: TaskBatch, name: str) -> None:
    geometry, classes, order = labelled(tasks)
    got, wanted = (P.named()[name] for P in (assembled(tasks, geometry, classes), tasks.parameters))
    for k, fingers in enumerate(order):
        touching = torch.from_numpy(tasks.samples[k].plan.modes != FREE)
        mine, yours = got[k][:, fingers], wanted[k]
        if name in ("facets", "cones"):
            mine, yours = mine[touching], yours[touching]
        torch.testing.assert_close(mine, yours, atol=1e-9, rtol=1e-9)


def test_the_program_costs_what_the_expert_s_plan_costs_without_having_seen_it(
    tasks: TaskBatch, program: InverseDynamics
) -> None:
    geometry, classes, _ = labelled(tasks)
    action = solve(program, assembled(tasks, geometry, classes), passes=6)
    assert action.solved.all()
    assert action.slack.abs().max() < 1e-6
    cost = Cost()
    speeding = (
        action.positions[:, 2:] - 2 * action.positions[:, 1:-1] + action.positions[:, :-2]
    ) / SETTINGS.dt**2
    total = cost.force * action.forces.square().sum((1, 2, 3)) + cost.acceleration * speeding.square().sum(
        (1, 2, 3)
    )
    wanted = torch.tensor([s.plan.objective for s in tasks.samples], dtype=torch.float64)
    torch.testing.assert_close(total, wanted, rtol=0.02, atol=0.0)


def test_what_it_finds_moves_the_object(tasks: TaskBatch, program: InverseDynamics) -> None:
    geometry, classes, _ = labelled(tasks)
    action = solve(program, assembled(tasks, geometry, classes), passes=5)
    outcome = execute(action, tasks, SimulatorSettings())
    assert outcome.success.all()


def differenced(f: object, x: Tensor, entry: tuple[int, ...], step: float) -> float:
    ends = []
    for sign in (1, -1):
        moved = x.detach().clone()
        moved[entry] += sign * step
        ends.append(float(f(moved)))  # type: ignore[operator]
    return (ends[0] - ends[1]) / (2 * step)


def test_gradients_reach_polygon_poses_and_margins_and_agree_with_differences(
    tasks: TaskBatch, program: InverseDynamics
) -> None:
    few = tasks[torch.arange(2)]
    geometry, classes, _ = labelled(few)
    weight = torch.rand(2, 5, 2, 2, dtype=torch.float64, generator=torch.Generator().manual_seed(0))

    def total(vertices: Tensor, poses: Tensor, margins: Tensor) -> Tensor:
        g = Geometry(vertices=vertices, count=geometry.count, poses=poses)
        given = Margins(facet=margins[0], cone=margins[1], push=margins[2])
        action = solve(program, assemble(g, classes, SCHEDULES, SETTINGS, given), passes=2)
        return (weight * (100 * action.positions + action.forces)).sum()

    start = [geometry.vertices, geometry.poses, torch.tensor([0.1, 0.6, 0.05], dtype=torch.float64)]
    inputs = [x.clone().requires_grad_() for x in start]
    gradients = torch.autograd.grad(total(*inputs), inputs)
    pairs = []
    # Heights stay: lifting a corner off the floor takes its contact away, which has no derivative.
    for which, entries in enumerate(
        [[(0, 1, 0), (1, 2, 0), (1, 0, 0)], [(0, 1, 0), (1, 3, 0)], [(0,), (1,), (2,)]]
    ):
        for entry in entries:

            def along(x: Tensor, which: int = which) -> Tensor:
                return total(*[x if k == which else y for k, y in enumerate(start)])

            pairs.append((float(gradients[which][entry]), differenced(along, start[which], entry, 1e-6)))
    ours, theirs = np.array(pairs).T
    assert np.abs(theirs).min() > 0
    np.testing.assert_allclose(ours, theirs, rtol=2e-3, atol=1e-3 * np.abs(theirs).max())
