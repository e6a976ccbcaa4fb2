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
from dlm.structured.examples import Example
from dlm.structured.losses import MOST_REGRET, regrets
from dlm.structured.planners import ClassPlanner, ExpertPlanner
from dlm.tasks import TaskBatch
from expert.problems.contact import FREE, ContactTask
from expert.verify.plan.check import check_plan

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


def test_all_classes_hold_the_expert_s_optimum_and_its_checker_agrees(sample: Sample) -> None:
    answer = ClassPlanner(schedules=SCHEDULES)(sample.task)
    assert answer.plan is not None
    assert answer.plan.objective == pytest.approx(sample.plan.objective, rel=2e-3)
    assert check_plan(answer.task, answer.plan).verdict == "sound"


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


def test_the_expert_as_a_planner_agrees_with_its_labels(tasks: TaskBatch) -> None:
    sample = tasks.samples[0]
    answer = ExpertPlanner()(sample.task)
    assert answer.plan is not None
    assert answer.plan.objective == pytest.approx(sample.plan.objective, rel=2e-3)


def test_regrets_vanish_at_the_expert_s_class_and_never_beat_it(sample: Sample) -> None:
    values = regrets(sample, SCHEDULES)
    classes = SCHEDULES.classes(len(sample.task.body.vertices)).tolist()
    own = classes.index(list(SCHEDULES.class_of(sample.plan.modes) or ()))
    assert values[own] == pytest.approx(0.0, abs=2e-2)
    assert ((values >= 0) & (values <= MOST_REGRET)).all()
    assert values.max() == MOST_REGRET


def test_mirrored_and_split_examples_keep_their_optimum(sample: Sample) -> None:
    example = Example.of(sample)
    again = example.mirrored().mirrored()
    np.testing.assert_allclose(again.vertices, example.vertices, atol=1e-12)
    assert (again.modes == example.modes).all()
    rng = np.random.default_rng(0)
    margin = sample.task.fingers.facet_margin
    for variant in (example.mirrored(), example.split(rng, 9), example.mirrored().split(rng, 12)):
        own = variant.contact_class(SCHEDULES)
        assert own is not None
        facet = np.maximum(variant.modes, 0)
        a, b = variant.vertices[facet], np.roll(variant.vertices, -1, axis=0)[facet]
        places = a + variant.rho[..., None] * (b - a)
        original = Example.of(sample)
        c, d = (
            original.vertices[np.maximum(original.modes, 0)],
            np.roll(original.vertices, -1, axis=0)[np.maximum(original.modes, 0)],
        )
        expected = c + original.rho[..., None] * (d - c)
        flip = np.sign(variant.poses[0, 0] * original.poses[0, 0]) if original.poses[0, 0] else 1.0
        touching = variant.modes != FREE
        np.testing.assert_allclose(places[touching], (expected * [flip, 1.0])[touching], atol=1e-9)
    assert 0 < margin < 0.5
