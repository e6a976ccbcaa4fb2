from dataclasses import replace
from pathlib import Path

import pytest
import torch
from matplotlib.figure import Figure

from dlm.evaluation.outcomes import act, execute
from dlm.execution import idle_where_unsolved, simulate
from dlm.inverse_dynamics.layer import InverseDynamics
from dlm.metrics import object_trajectory_loss
from dlm.neural import NeuralArchitecture, PointerPolicy
from dlm.neural.losses import ExpectedMotionLoss
from dlm.neural.policies import geometry_of
from dlm.policy import Loss
from dlm.simulator import SimulatorSettings
from dlm.structured.losses import CheckedClassLoss, ClassLoss
from dlm.structured.policies import ProposalPolicy
from dlm.tasks import TaskBatch
from dlm.training.checkpoint import load, restore_weights
from dlm.training.loop import Record, Row, Training, Watch, fit
from dlm.training.stage import Schedule, Stage
from expert.errors import InvalidProblem

SMALL = NeuralArchitecture(width=16, layers=1, heads=2)
SMOOTH = SimulatorSettings(kappa=1250.0)
QUIET = Watch(measure=lambda policy: {}, picture=lambda policy: Figure(figsize=(1, 1)))


@pytest.fixture(scope="module")
def program() -> InverseDynamics:
    return InverseDynamics(backend="batched")


def train(
    tasks: TaskBatch,
    path: Path,
    policy: ProposalPolicy | torch.nn.Module,
    loss: Loss,
    *,
    resume: bool = False,
    iterations: int = 4,
    rate: float = 3e-3,
) -> list[Row]:
    stage = Stage(name=path.stem, policy="program", loss=loss, dataset="train")
    plan = Schedule(iterations=iterations, batch_size=2, learning_rate=rate, log_every=1, save_every=1)
    training = Training(policy, loss, tasks, plan)  # type: ignore[arg-type]
    fit(training, Record(path=path, stage=stage, model="neural", settings={}), watch=QUIET, resume=resume)
    return training.history


STAGES: dict[str, Loss] = {
    "mdr": ClassLoss(),
    "cvx": CheckedClassLoss(),
    "dlm": ExpectedMotionLoss(simulator=SMOOTH, classes=2),
}


@pytest.mark.parametrize("stage", STAGES)
def test_a_stopped_training_reaches_the_same_weights(
    tasks: TaskBatch, tmp_path: Path, program: InverseDynamics, stage: str
) -> None:
    loss = STAGES[stage]

    def again(name: str, iterations: int, *, resume: bool = False) -> list[Row]:
        policy = SMALL.build("program", program, seed=1)
        return train(
            tasks, tmp_path / f"{name}.safetensors", policy, loss, iterations=iterations, resume=resume
        )

    whole = again("whole", 4)
    again("cut", 2)
    assert again("cut", 4, resume=True) == whole
    ends = [load(tmp_path / f"{name}.safetensors", command="").model for name in ("whole", "cut")]
    assert all(torch.equal(ends[0][key], ends[1][key]) for key in ends[0])
    assert len({row["loss"] for row in whole}) == 4  # it did learn something


def test_four_tasks_learnt_by_heart_are_executed_from_video(
    tasks: TaskBatch, tmp_path: Path, program: InverseDynamics
) -> None:
    policy = SMALL.build("program", program, seed=1)
    loss = ClassLoss(splitting=False, mirroring=False)
    history = train(tasks, tmp_path / "mdr.safetensors", policy, loss, iterations=60, rate=1e-2)
    assert history[-1]["loss"] < 0.1 * history[0]["loss"]
    outcome = execute(act(policy, tasks), tasks, SimulatorSettings())
    assert outcome.solved.all()
    assert outcome.success.all()
    checked = SMALL.build("proposals", seed=0)
    saved = load(tmp_path / "mdr.safetensors", command="")
    restore_weights(checked.weights(), saved, name="neural", source=tmp_path)
    assert execute(act(checked, tasks), tasks, SimulatorSettings()).success.all()


def test_videos_without_an_object_are_unsolved_and_leave_the_others_alone(
    tasks: TaskBatch, program: InverseDynamics
) -> None:
    policy = SMALL.build("program", program, seed=1).eval()
    video = tasks.video.clone()
    video[1] = video[1, 0, 0, 0]
    with torch.no_grad():
        some, every, none = policy(video), policy(tasks.video), policy(video[1:2])
    assert some.solved.tolist() == [True, False, True, True]
    assert not none.solved.any()
    torch.testing.assert_close(some.positions[[0, 2, 3]], every.positions[[0, 2, 3]])
    assert policy.derender(video) is None
    P = policy.derender(tasks.video)
    assert P is not None
    torch.testing.assert_close(P.poses, tasks.poses, atol=1e-2, rtol=0.0)


def test_the_expected_motion_weighs_classes_by_their_shares(
    tasks: TaskBatch, program: InverseDynamics
) -> None:
    policy = SMALL.build("program", program, seed=1)
    assert isinstance(policy, PointerPolicy)
    few = tasks[torch.arange(2)]
    loss = ExpectedMotionLoss(simulator=SMOOTH, classes=3)
    seen, _ = policy.seen(few.video)
    losses, value = [], loss(policy, few)
    geometry = geometry_of(seen)
    classes, shares = policy.likeliest(geometry, 3)
    with torch.no_grad():
        for k in range(3):
            action = idle_where_unsolved(policy.act(geometry, classes[:, k]), few)
            losses.append(object_trajectory_loss(simulate(action, few, SMOOTH), few.poses))
    wanted = (shares.exp() * (torch.stack(losses, 1) / loss.near).log1p()).sum(1).mean()
    torch.testing.assert_close(value, wanted)


def test_the_action_s_gradient_in_the_calibration_agrees_with_differences(
    tasks: TaskBatch, program: InverseDynamics
) -> None:
    policy = SMALL.build("program", program, seed=1)
    assert isinstance(policy, PointerPolicy)
    geometry = geometry_of(policy.seen(tasks.video[:2])[0])
    classes = policy.likeliest(geometry, 1)[0][:, 0]
    weight = torch.rand(2, 5, 2, 2, dtype=torch.float64, generator=torch.Generator().manual_seed(0))

    def total() -> torch.Tensor:
        action = policy.act(geometry, classes)
        return (weight * (100 * action.positions + action.forces)).sum()

    (gradient,) = torch.autograd.grad(total(), policy.knobs)
    assert not gradient[:4].any()  # where the camera is has no part in the program
    for knob in (4, 5):
        ends = []
        for sign in (1, -1):
            with torch.no_grad():
                policy.knobs[knob] += sign * 1e-4
                ends.append(float(total()))
                policy.knobs[knob] -= sign * 1e-4
        assert float(gradient[knob]) == pytest.approx((ends[0] - ends[1]) / 2e-4, rel=1e-2)


def test_simulated_motion_reaches_network_and_calibration(tasks: TaskBatch, program: InverseDynamics) -> None:
    policy = SMALL.build("program", program, seed=1)
    ExpectedMotionLoss(simulator=SMOOTH, classes=40)(policy, tasks[torch.arange(2)]).backward()
    unused = {n for n, p in policy.named_parameters() if p.grad is None or not p.grad.any()}
    assert unused == set()


def test_policies_and_losses_of_another_model_are_refused(tasks: TaskBatch) -> None:
    with pytest.raises(InvalidProblem, match=r"stage\.policy"):
        SMALL.build("best_guess")
    with pytest.raises(InvalidProblem, match="a policy that points"):
        ExpectedMotionLoss(simulator=SMOOTH)(SMALL.build("proposals"), tasks)
    with pytest.raises(InvalidProblem, match=r"model\.passes"):
        replace(SMALL, passes=0)
