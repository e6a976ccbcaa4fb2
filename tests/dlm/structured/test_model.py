from dataclasses import replace

import numpy as np
import pytest
import torch

from datasets.motions import TaskSettings
from dlm.evaluation.outcomes import act, execute
from dlm.metrics import object_trajectory_loss
from dlm.perception import Perceived
from dlm.simulator import SimulatorSettings, replay
from dlm.structured import ClassPlanner, ExpertPlanner, Planning, StructuredModel
from dlm.structured.calibration import NAMES, Calibration, deflated
from dlm.structured.policies import StructuredArchitecture
from dlm.structured.trial import Trial
from dlm.tasks import TaskBatch
from expert.errors import InvalidProblem
from expert.geometry.pose import Array, to_world
from expert.problems.contact import ContactTask, Plan


def seen_by_label(tasks: TaskBatch, k: int) -> Perceived:
    """The label's geometry, as if perception were perfect."""
    task = tasks.samples[k].task
    return Perceived(vertices=task.body.vertices, poses=task.trajectory.poses, residual=0.0, noise=0.0)


def executed(tasks: TaskBatch, k: int, model: StructuredModel, perceived: Perceived) -> float:
    planned = model.plan(perceived)
    assert planned.plan is not None
    desired = tasks.samples[k].task.trajectory.poses
    return float(
        object_trajectory_loss(
            replay(tasks.samples[k].task, planned.plan.positions, planned.plan.forces).poses, desired
        )
    )


@pytest.mark.parametrize("k", range(4))
def test_every_way_to_plan_moves_the_object_at_true_geometry(tasks: TaskBatch, k: int) -> None:
    untrained = (
        StructuredArchitecture().proposer("proposals").model
    )  # proposals in random order: the check decides
    for model in (StructuredModel(), untrained, StructuredModel(planner=ExpertPlanner())):
        assert executed(tasks, k, model, seen_by_label(tasks, k)) < 1e-3


def test_from_video_to_motion(tasks: TaskBatch) -> None:
    policy = StructuredArchitecture().proposer("proposals")
    outcome = execute(act(policy, tasks), tasks, SimulatorSettings())
    assert outcome.solved.all()
    assert outcome.success.all()
    assert outcome.object_loss.max() < 5e-3


def test_parameters_of_a_plan_are_those_of_4_ct4(tasks: TaskBatch) -> None:
    planned = StructuredModel().plan(seen_by_label(tasks, 0))
    assert planned.status == "planned"
    assert planned.parameters is not None
    np.testing.assert_array_equal(planned.parameters.reference_positions, planned.plan.positions)
    assert planned.action().solved.tolist() == [True]


def test_what_cannot_be_done_is_said_and_not_planned(tasks: TaskBatch) -> None:
    weak = TaskSettings(facet_margin=0.2, force_limit=0.1)
    k = next(i for i, s in enumerate(tasks.samples) if "lift" in s.family)
    planned = StructuredModel(planning=Planning(tasks=weak)).plan(seen_by_label(tasks, k))
    assert planned.status == "no_plan"
    assert "no plan among" in planned.reason
    assert planned.plan is None
    assert planned.parameters is None
    assert planned.action().solved.tolist() == [False]


def test_a_doubtful_fit_keeps_its_doubts(tasks: TaskBatch) -> None:
    doubtful = replace(seen_by_label(tasks, 0), status="poor_fit", reason="something is in front")
    planned = StructuredModel().plan(doubtful)
    assert (planned.status, planned.reason) == ("poor_fit", "something is in front")
    assert planned.plan is not None


def test_geometry_that_makes_no_object_has_no_plan(tasks: TaskBatch) -> None:
    crossing = np.array([[0, 0], [0.05, 0.05], [0.05, 0], [0, 0.05]]) - 0.025
    planned = StructuredModel().plan(replace(seen_by_label(tasks, 0), vertices=crossing))
    assert planned.status == "no_plan"
    assert "simple polygon" in planned.reason


def test_another_number_of_frames_is_refused(tasks: TaskBatch) -> None:
    with pytest.raises(InvalidProblem, match="poses: expected 5, got 4; resample"):
        StructuredModel().plan(replace(seen_by_label(tasks, 0), poses=seen_by_label(tasks, 0).poses[:4]))


def test_an_empty_video_is_an_error_for_users_and_unsolved_for_training(tasks: TaskBatch) -> None:
    nothing = np.full_like(tasks.samples[0].video, 240)
    with pytest.raises(InvalidProblem, match="video"):
        StructuredModel().act(nothing)
    action = StructuredArchitecture().proposer("proposals")(torch.from_numpy(nothing)[None])
    assert action.solved.tolist() == [False]


def blown_up(vertices: Array, distance: float) -> Array:
    """Every side moved out."""
    edge = np.roll(vertices, -1, axis=0) - vertices
    normal = np.stack([edge[:, 1], -edge[:, 0]], -1) / np.linalg.norm(edge, axis=1, keepdims=True)
    before = np.roll(normal, 1, axis=0)
    return vertices + distance * (normal + before) / (1 + (normal * before).sum(1, keepdims=True))


@pytest.mark.parametrize("k", range(4))
def test_deflating_what_was_blown_up_gives_the_object_back_with_its_contacts(
    tasks: TaskBatch, k: int
) -> None:
    distance, true = 5e-4, seen_by_label(tasks, k)
    vertices = blown_up(true.vertices, distance)
    poses = true.poses.copy()
    heights = to_world(poses, vertices)[..., 1].min(axis=1)
    resting = to_world(true.poses, true.vertices)[..., 1].min(axis=1) < 1e-6
    poses[resting, 1] -= heights[resting]  # perception lets it touch
    back = deflated(Perceived(vertices=vertices, poses=poses, residual=0.0, noise=0.0), distance)
    np.testing.assert_allclose(back.vertices, true.vertices, atol=1e-9)
    np.testing.assert_allclose(back.poses[:, [0, 2]], true.poses[:, [0, 2]], atol=1e-9)
    np.testing.assert_allclose(back.poses[resting, 1], true.poses[resting, 1], atol=1e-9)


def test_calibration_changes_what_it_names_and_stays_sensible() -> None:
    model = StructuredModel()
    assert model.calibrated(Calibration()) == model
    for name in NAMES:
        assert model.calibrated(Calibration(**{name: 1e-3})) != model
    wild = model.calibrated(Calibration.of(np.full(len(NAMES), 1e3)))
    assert wild.planning.tasks.facet_margin <= 0.45
    assert wild.planning.tasks.cone_fraction <= 1
    with pytest.raises(InvalidProblem, match=r"calibration\.blur"):
        Calibration(blur=np.nan)


def test_a_trial_tells_a_sound_plan_from_one_that_drops_the_object(tasks: TaskBatch) -> None:
    k = next(i for i, s in enumerate(tasks.samples) if "lift" in s.family)
    sample, trial = tasks.samples[k], Trial()
    assert trial.risk(sample.task, sample.plan) < trial.good
    centres = sample.task.trajectory.poses[:, None, :2]
    wide = replace(sample.plan, positions=centres + 1.2 * (sample.plan.positions - centres))
    assert trial.risk(sample.task, wide) > 0.1
    broken = replace(sample.plan, forces=sample.plan.forces * np.nan)
    assert not trial.risk(sample.task, broken) <= trial.good


def test_what_fails_its_trial_is_replaced_or_called_risky(tasks: TaskBatch) -> None:
    class Suspicious(Trial):
        """Finds fault with the first plan that it sees."""

        def risk(self, task: ContactTask, plan: Plan) -> float:
            seen.append(plan)
            return 1.0 if len(seen) == 1 else 0.5 if self.candidates == 2 else 0.0

    for candidates, status in ((3, "planned"), (2, "risky")):
        seen: list[Plan] = []
        model = StructuredModel(planner=ClassPlanner(trial=Suspicious(candidates=candidates)))
        planned = model.plan(seen_by_label(tasks, 0))
        assert planned.status == status
        assert any((seen[0].modes != other.modes).any() for other in seen[1:])
        assert planned.plan is not seen[0]
        assert ("0.5 cm^2" in planned.reason) == (status == "risky")
