from dlm.thesis.losses import ParameterLoss
from dlm.training.orchestrate import chains
from dlm.training.stage import Stage


def stage(name: str, start: str | None = None) -> Stage:
    return Stage(name=name, policy="program", loss=ParameterLoss(), dataset="train", warm_start=start)


def names(*stages: Stage) -> list[list[str]]:
    return [[s.name for s in row] for row in chains(stages)]


def test_stages_that_need_one_another_stay_in_order_and_the_longest_chain_comes_first() -> None:
    all_five = [stage("nn"), stage("nnm", "nn"), stage("mdr"), stage("cvx", "mdr"), stage("dlm", "cvx")]
    assert names(*all_five) == [["mdr", "cvx", "dlm"], ["nn", "nnm"]]


def test_a_stage_whose_start_is_not_trained_now_waits_for_nobody() -> None:
    assert names(stage("cvx", "mdr"), stage("nnm", "nn")) == [["cvx"], ["nnm"]]
