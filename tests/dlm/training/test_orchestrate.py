import os
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest
import torch
from matplotlib.figure import Figure

from dlm.inverse_dynamics.layer import InverseDynamics
from dlm.inverse_dynamics.parameters import Layout
from dlm.tasks import TaskBatch
from dlm.thesis.derender import NetworkSizes
from dlm.thesis.losses import ParameterLoss
from dlm.thesis.policies import ThesisArchitecture
from dlm.training.checkpoint import load, read_about
from dlm.training.loop import Watch
from dlm.training.orchestrate import DataSets, Run, chains, checkpoint_path, iterations_done, train
from dlm.training.stage import Schedule, Stage
from expert.errors import InvalidProblem
from expert.files.output import claimed

SMALL = NetworkSizes(channels=(2, 3, 4), latent=8, recurrent_layers=1, hidden_layers=1)
PLAIN = {"stages": {"mdr": {"a": 1}, "cvx": {"b": 2}}, "seed": 3}


def stage(name: str, start: str | None = None) -> Stage:
    return Stage(name=name, policy="program", loss=ParameterLoss(), dataset="train", warm_start=start)


def names(*stages: Stage) -> list[list[str]]:
    return [[s.name for s in row] for row in chains(stages)]


def test_stages_that_need_one_another_stay_in_order_and_the_longest_chain_comes_first() -> None:
    all_five = [stage("nn"), stage("nnm", "nn"), stage("mdr"), stage("cvx", "mdr"), stage("dlm", "cvx")]
    assert names(*all_five) == [["mdr", "cvx", "dlm"], ["nn", "nnm"]]


def test_a_stage_whose_start_is_not_trained_now_waits_for_nobody() -> None:
    assert names(stage("cvx", "mdr"), stage("nnm", "nn")) == [["cvx"], ["nnm"]]


def quiet(tasks: DataSets) -> Watch:
    return Watch(measure=lambda policy: {}, picture=lambda policy: Figure(figsize=(1, 1)))


@pytest.fixture
def run(tasks: TaskBatch, tmp_path: Path) -> Callable[..., Run]:
    """Two small stages, one after the other."""
    return partial(
        Run,
        seed=3,
        stages=[stage("mdr"), stage("cvx", "mdr")],
        model=ThesisArchitecture(sizes=SMALL, layout=Layout()),
        program=InverseDynamics,
        schedule=Schedule(iterations=2, seed=3),
        read=lambda: {"train": tasks},
        watch=quiet,
        folder=tmp_path / "seed_3",
        settings=PLAIN,
    )


def test_stages_follow_one_another_and_say_what_made_them(run: Callable[..., Run]) -> None:
    one = run()
    lines = list(train([one], jobs=1))
    assert [line.split(":")[0] for line in lines] == ["mdr", "cvx"]
    for name, own in (("mdr", {"a": 1}), ("cvx", {"b": 2})):
        about = read_about(checkpoint_path(one.folder, name), command="")
        assert about.settings == {"seed": 3, "stage": own}
        assert (about.model, about.iteration) == ("thesis", 2)


def test_a_warm_start_begins_with_the_weights_of_the_stage_before(run: Callable[..., Run]) -> None:
    """With steps that hardly move them, the weights of the second stage are those of the first."""
    still = run(schedule=Schedule(iterations=1, learning_rate=1e-12, seed=3))
    moved = replace(still, schedule=Schedule(iterations=2, learning_rate=1e-2, seed=3))
    tasks = still.read()
    first, second = still.stages
    moved.train(first, tasks)
    still.train(second, tasks)
    before, after = (
        load(checkpoint_path(still.folder, n), command="").model["derenderer.encoder.join.weight"]
        for n in ("mdr", "cvx")
    )
    torch.testing.assert_close(after, before, atol=1e-9, rtol=0)


def test_a_missing_warm_start_is_named_with_its_command(run: Callable[..., Run]) -> None:
    one = run()
    with pytest.raises(InvalidProblem, match=r"python train\.py stage=mdr model=thesis seed=3"):
        one.train(one.stages[1], one.read())
    with pytest.raises(InvalidProblem, match="jobs: expected a number of processes, got 0"):
        list(train([one], jobs=0))


def test_iterations_of_earlier_runs_count_only_where_they_are_gone_on_from(run: Callable[..., Run]) -> None:
    one = run()
    assert iterations_done([one], 0.0) == 0
    one.train(one.stages[0], one.read())
    assert iterations_done([one], 0.0) == 2
    later = time.time() + 60
    assert iterations_done([one], later) == 0
    assert iterations_done([replace(one, resume=True)], later) == 2


def test_two_trainings_of_one_stage_do_not_write_over_each_other(run: Callable[..., Run]) -> None:
    one = run()
    tasks = one.read()
    with (
        claimed(one.folder / "mdr"),
        pytest.raises(InvalidProblem, match=f"mdr, which process {os.getpid()} is about to write"),
    ):
        one.train(one.stages[0], tasks)
    assert not checkpoint_path(one.folder, "mdr").exists()
    one.train(one.stages[0], tasks)
    assert {p.name for p in one.folder.iterdir()} == {"mdr.safetensors", "tensorboard"}
