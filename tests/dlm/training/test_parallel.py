import time
from functools import partial
from pathlib import Path

import pytest

from dlm.thesis.losses import ParameterLoss
from dlm.training.parallel import chains, run_side_by_side
from dlm.training.stage import Stage
from expert.errors import InvalidProblem


def stage(name: str, start: str | None = None) -> Stage:
    return Stage(name=name, policy="program", loss=ParameterLoss(), dataset="train", warm_start=start)


def names(*stages: Stage) -> list[list[str]]:
    return [[s.name for s in row] for row in chains(stages)]


def test_stages_that_need_one_another_stay_in_order_and_the_longest_chain_comes_first() -> None:
    all_five = [stage("nn"), stage("nnm", "nn"), stage("mdr"), stage("cvx", "mdr"), stage("dlm", "cvx")]
    assert names(*all_five) == [["mdr", "cvx", "dlm"], ["nn", "nnm"]]


def test_a_stage_whose_start_is_not_trained_now_waits_for_nobody() -> None:
    assert names(stage("cvx", "mdr"), stage("nnm", "nn")) == [["cvx"], ["nnm"]]


def call(folder: Path, k: int) -> list[str]:
    if k < 0:
        raise InvalidProblem("data", expected="a number >= 0", got=f"{k}")
    time.sleep(0.05)
    (folder / f"{k}").touch()
    return [f"{k}a", f"{k}b"]


def test_calls_run_in_other_processes_and_their_lines_come_back(tmp_path: Path) -> None:
    lines = run_side_by_side(
        [partial(call, tmp_path, k) for k in range(3)], jobs=2, progress=lambda: 0, total=3
    )
    assert sorted(lines) == ["0a", "0b", "1a", "1b", "2a", "2b"]
    assert {p.name for p in tmp_path.iterdir()} == {"0", "1", "2"}


def test_what_a_worker_refuses_is_said_by_the_master(tmp_path: Path) -> None:
    with pytest.raises(InvalidProblem, match="data: expected a number >= 0, got -1"):
        list(run_side_by_side([partial(call, tmp_path, -1)], jobs=2, progress=lambda: 0, total=1))
