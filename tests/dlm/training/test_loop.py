from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch
from matplotlib.figure import Figure

from dlm.inverse_dynamics.layer import InverseDynamics
from dlm.inverse_dynamics.parameters import Layout
from dlm.policy import Policy
from dlm.tasks import TaskBatch
from dlm.thesis.derender import NetworkSizes
from dlm.thesis.losses import ParameterLoss
from dlm.thesis.policies import ThesisArchitecture
from dlm.training.checkpoint import load
from dlm.training.loop import Record, Row, Training, Watch, fit
from dlm.training.stage import Schedule, Stage
from expert.errors import InvalidProblem, SolverFailed

STAGE = Stage(name="mdr", policy="program", loss=ParameterLoss(), dataset="train")


SMALL = NetworkSizes(channels=(2, 3, 4), latent=8, recurrent_layers=1, hidden_layers=1)


MODEL = ThesisArchitecture(sizes=SMALL, layout=Layout())


QUIET = Watch(measure=lambda policy: {}, picture=lambda policy: Figure(figsize=(1, 1)))


@pytest.fixture(scope="module")
def program() -> InverseDynamics:
    return InverseDynamics()


class Interrupted(Exception):
    pass


def train(
    tasks: TaskBatch,
    program: InverseDynamics,
    path: Path,
    *,
    resume: bool = False,
    watch: Watch = QUIET,
    seed: int = 3,
    settings: dict[str, object] | None = None,
    **schedule: float | str,
) -> list[Row]:
    policy = MODEL.build("program", program, seed=seed)
    policy.fit_centre(tasks)
    every: dict[str, Any] = {"iterations": 6, "batch_size": 2, "save_every": 2, "log_every": 1, **schedule}
    plan = Schedule(seed=seed, **every)
    training = Training(policy, STAGE.loss, tasks, plan)
    record = Record(path=path, stage=STAGE, model="thesis", settings=settings or {})
    fit(training, record, watch=watch, resume=resume)
    return training.history


def test_the_same_seed_gives_the_same_losses(
    tasks: TaskBatch, program: InverseDynamics, tmp_path: Path
) -> None:
    first = train(tasks, program, tmp_path / "a" / "mdr.safetensors")
    torch.rand(5)  # the caller's random numbers do not matter
    assert train(tasks, program, tmp_path / "b" / "mdr.safetensors") == first
    assert train(tasks, program, tmp_path / "c" / "mdr.safetensors", seed=4) != first


def test_training_leaves_the_callers_random_numbers_alone(
    tasks: TaskBatch, program: InverseDynamics, tmp_path: Path
) -> None:
    before = torch.get_rng_state()
    train(tasks, program, tmp_path / "mdr.safetensors", iterations=1)
    assert torch.equal(torch.get_rng_state(), before)


@pytest.mark.parametrize(("stop_at", "decay"), [(1, "constant"), (3, "cosine"), (4, "constant")])
def test_a_killed_stage_resumes_to_the_losses_and_weights_of_an_undisturbed_one(
    tasks: TaskBatch, program: InverseDynamics, tmp_path: Path, stop_at: int, decay: str
) -> None:
    whole, broken = tmp_path / "whole.safetensors", tmp_path / "broken.safetensors"
    undisturbed = train(tasks, program, whole, decay=decay)
    seen = []

    def stop(policy: Policy) -> Row:
        seen.append(policy)
        if len(seen) == stop_at:
            raise Interrupted
        return {}

    with pytest.raises(Interrupted):
        train(tasks, program, broken, watch=Watch(measure=stop, picture=QUIET.picture), decay=decay)
    assert train(tasks, program, broken, resume=True, decay=decay) == undisturbed
    a, b = load(whole, command=""), load(broken, command="")
    assert all(torch.equal(a.model[k], b.model[k]) for k in a.model)
    assert all(torch.equal(a.optimiser[k], b.optimiser[k]) for k in a.optimiser)


def test_resuming_a_finished_stage_changes_nothing_and_more_iterations_go_on(
    tasks: TaskBatch, program: InverseDynamics, tmp_path: Path
) -> None:
    path = tmp_path / "mdr.safetensors"
    train(tasks, program, path, iterations=4)
    before = load(path, command="")
    train(tasks, program, path, iterations=4, resume=True)
    after = load(path, command="")
    assert all(torch.equal(before.model[k], after.model[k]) for k in before.model)
    longer = train(tasks, program, path, iterations=6, resume=True)
    assert longer == train(tasks, program, tmp_path / "whole.safetensors", iterations=6)


def test_a_decaying_stage_takes_smaller_and_smaller_steps_and_cannot_be_prolonged(
    tasks: TaskBatch, program: InverseDynamics, tmp_path: Path
) -> None:
    policy = MODEL.build("program", program, seed=0)
    policy.fit_centre(tasks)
    plan = Schedule(iterations=4, batch_size=2, learning_rate=1e-3, decay="cosine")
    training = Training(policy, STAGE.loss, tasks, plan)
    moves = []
    for _ in range(4):
        before = torch.cat([p.detach().flatten() for p in policy.parameters()])
        training.iterate()
        after = torch.cat([p.detach().flatten() for p in policy.parameters()])
        moves.append(float((after - before).abs().max()))
    assert moves[3] < 0.2 * moves[0]
    path, settings = tmp_path / "mdr.safetensors", {"schedule": {"iterations": 2, "decay": "cosine"}}
    train(tasks, program, path, iterations=2, decay="cosine", settings=dict(settings))
    longer: dict[str, object] = {"schedule": {"iterations": 3, "decay": "cosine"}}
    with pytest.raises(InvalidProblem, match=r"another schedule\.iterations"):
        train(tasks, program, path, iterations=3, decay="cosine", settings=longer, resume=True)


def test_four_tasks_are_learnt_by_heart_without_dropout(tasks: TaskBatch) -> None:
    sizes = replace(SMALL, dropout=0.0)
    policy = ThesisArchitecture(sizes=sizes, layout=Layout()).build("program", torch.nn.Identity(), seed=0)
    policy.fit_centre(tasks)
    schedule = Schedule(batch_size=4, learning_rate=1e-2)
    training = Training(policy, STAGE.loss, tasks, schedule)
    losses = [training.iterate() for _ in range(100)]
    assert losses[-1] < 0.1 * losses[0]


def test_other_settings_or_other_data_are_not_resumed(
    tasks: TaskBatch, program: InverseDynamics, tmp_path: Path
) -> None:
    path = tmp_path / "mdr.safetensors"
    settings: dict[str, object] = {"schedule": {"learning_rate": 1e-4, "iterations": 2}}
    train(tasks, program, path, iterations=2, settings=settings)
    before = path.read_bytes()
    other: dict[str, object] = {"schedule": {"learning_rate": 2e-4, "iterations": 9}}
    with pytest.raises(InvalidProblem, match=r"another schedule\.learning_rate"):
        train(tasks, program, path, iterations=2, settings=other, resume=True)
    changed = TaskBatch.of(tasks.samples, fingerprint="other")
    with pytest.raises(InvalidProblem, match="other contents"):
        train(changed, program, path, iterations=2, settings=settings, resume=True)
    assert path.read_bytes() == before


def test_a_loss_that_is_not_finite_stops_the_stage_and_keeps_the_checkpoint(
    tasks: TaskBatch, program: InverseDynamics, tmp_path: Path
) -> None:
    policy = MODEL.build("program", program, seed=0)
    training = Training(
        policy, lambda p, t: p.derenderer(t.video).sum() * torch.nan, tasks, Schedule(batch_size=4)
    )
    with pytest.raises(SolverFailed, match="iteration 1: the loss or its gradient is not finite"):
        training.iterate()


def test_batches_hold_every_task_once(tasks: TaskBatch, program: InverseDynamics) -> None:
    policy = MODEL.build("program", program, seed=0)
    training = Training(policy, STAGE.loss, tasks, Schedule(batch_size=3))
    batches = training._batches()
    assert [len(b) for b in batches] == [2, 2]
    assert sorted(torch.cat(batches).tolist()) == [0, 1, 2, 3]
