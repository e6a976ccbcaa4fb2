from dataclasses import replace

import numpy as np
import pytest
import torch

from datasets.parameters import parameters_of
from datasets.specification import Sample
from dlm.inverse_dynamics.layer import InverseDynamics
from dlm.inverse_dynamics.parameters import ParameterBatch
from dlm.structured.check import check
from dlm.structured.classes import Schedules
from dlm.structured.planners import ClassPlanner
from dlm.tasks import TaskBatch
from expert.problems.contact import FREE, ContactTask

SCHEDULES = Schedules()


@pytest.fixture(params=range(4))
def sample(request: pytest.FixtureRequest, tasks: TaskBatch) -> Sample:
    return tasks.samples[request.param]


def weightless_fingers(task: ContactTask) -> ContactTask:
    """The same task for fingers that can hardly push: no plan lifts or turns anything."""
    return replace(
        task,
        fingers=replace(task.fingers, max_force=1e-3),
        robustness=replace(task.robustness, min_normal_force=0.0),
    )


def test_the_class_of_a_label_has_the_label_as_its_best_plan(sample: Sample) -> None:
    own = SCHEDULES.class_of(sample.plan.modes)
    assert own is not None
    plan = check(sample.task, SCHEDULES.modes(np.array([own]))).plan
    assert plan is not None
    assert plan.objective == pytest.approx(sample.plan.objective, rel=1e-6)
    touching = plan.modes != FREE
    order = [0, 1] if (plan.modes == sample.plan.modes).all() else [1, 0]
    np.testing.assert_allclose(plan.positions[touching], sample.plan.positions[:, order][touching], atol=1e-6)


def test_the_program_at_the_assembled_parameters_gives_the_plan(sample: Sample) -> None:
    plan = ClassPlanner(schedules=SCHEDULES)(sample.task).plan
    assert plan is not None
    layer = InverseDynamics(backend="batched", slack=None)
    action = layer(ParameterBatch.stack([parameters_of(sample.task, plan)]))
    assert bool(action.solved.all())
    touching = torch.from_numpy(plan.modes != FREE)
    size = sample.task.body.size
    assert float((action.positions[0] - torch.from_numpy(plan.positions))[touching].abs().max()) < 1e-4 * size
    assert float((action.forces[0] - torch.from_numpy(plan.forces)).abs().max()) < 1e-4 * sample.task.weight


def test_hopeless_classes_are_proved_so_and_nothing_is_made_up(sample: Sample) -> None:
    task = weightless_fingers(sample.task)
    if sample.family == "slide":
        pytest.skip("a slide is lost to friction, which the floor decides")
    found = check(task, SCHEDULES.modes(SCHEDULES.classes(len(task.body.vertices))))
    assert found.plan is None
    assert np.isinf(found.bounds).all()
