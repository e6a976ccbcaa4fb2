import numpy as np
import pytest

from dlm.evaluation.outcomes import Outcome
from dlm.evaluation.study import IDLE, ORACLE, Study
from dlm.evaluation.trained import Trained
from dlm.execution import expert_action
from dlm.inverse_dynamics.layer import InverseDynamics
from dlm.inverse_dynamics.parameters import Layout
from dlm.tasks import TaskBatch
from dlm.thesis.derender import NetworkSizes
from dlm.thesis.losses import ActionLoss
from dlm.thesis.policies import ThesisArchitecture
from dlm.training.checkpoint import About
from dlm.training.stage import Stage
from tests.support.outcomes import RIGID

SMALL = NetworkSizes(channels=(2, 3, 4), latent=8, recurrent_layers=1, hidden_layers=1)


def trained(name: str, tasks: TaskBatch, start: str | None = None) -> Trained:
    """Two seeds of a perceptron that never learned."""
    model = ThesisArchitecture(sizes=SMALL, layout=Layout())
    policies = [model.build("perceptron", InverseDynamics(), seed=s) for s in (0, 1)]
    for policy in policies:
        policy.fit_centre(tasks)
    stage = Stage(name=name, policy="perceptron", loss=ActionLoss(), dataset="train", warm_start=start)
    about = About(stage=name, model="thesis", iteration=1, settings={}, data="", history=[], seconds=30.0)
    return Trained(stage=stage, policies=policies, abouts=[about, about])


@pytest.fixture
def study(tasks: TaskBatch) -> Study:
    return Study(
        trained=[trained("nn", tasks), trained("nnm", tasks, "nn")],
        tasks=dict.fromkeys(("train", "test", "family"), tasks),
        simulator=RIGID,
        baselines={"again": expert_action},
    )


@pytest.fixture
def outcomes(study: Study) -> dict[str, dict[str, list[Outcome]]]:
    return study.outcomes()


def test_architectures_stand_between_doing_nothing_and_the_oracle(
    outcomes: dict[str, dict[str, list[Outcome]]],
) -> None:
    assert list(outcomes) == [IDLE, "NN", "NNM", "again", ORACLE]
    assert [len(row["test"]) for row in outcomes.values()] == [1, 2, 2, 1, 1]
    np.testing.assert_array_equal(outcomes["again"]["test"][0].poses, outcomes[ORACLE]["test"][0].poses)
    assert outcomes[ORACLE]["test"][0].success.all()


def test_the_table_times_what_was_trained_and_compares_each_stage_with_its_start(
    study: Study, outcomes: dict[str, dict[str, list[Outcome]]]
) -> None:
    table = study.table(outcomes, {"command": "x"})
    by_name = {line.model: line for line in table.lines}
    assert [line.judged for line in table.lines] == [False, True, True, True, False]
    assert by_name["NN"].forward is not None
    assert by_name["again"].forward is None
    assert by_name[ORACLE].backward is None
    pairs = {(c.first, c.second) for c in table.comparisons}
    assert pairs == {("NN", "NNM"), (IDLE, "NN"), (IDLE, "NNM"), (IDLE, "again")}
    assert all(c.p_ranks == 1 for c in table.comparisons if c.second == "NNM" and c.first == "NN")
    assert table.origin["training, processor minutes"] == {"NN": "1.0", "NNM": "1.0"}


def test_the_report_shows_the_first_tasks_of_family_and_test_set(
    study: Study, outcomes: dict[str, dict[str, list[Outcome]]]
) -> None:
    report = study.report(outcomes, study.table(outcomes, {}), examples=1)
    assert [e.title.split(":")[0] for e in report.examples] == ["family 0", "test 0"]
    assert list(report.examples[0].films) == ["input", "NN", "NNM", "again", ORACLE]
