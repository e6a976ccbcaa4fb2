import pytest

from datasets.specification import Sample
from dlm.structured import StructuredModel
from dlm.structured.classes import Schedules
from dlm.structured.planners import ClassPlanner, ExpertPlanner
from dlm.structured.policies import StructuredArchitecture
from dlm.structured.trial import Trial
from dlm.tasks import TaskBatch
from expert.problems.contact import ContactTask, Plan
from expert.verify.plan.check import check_plan
from tests.support.structured import executed, seen_by_label


@pytest.mark.parametrize("k", range(4))
def test_every_way_to_plan_moves_the_object_at_true_geometry(tasks: TaskBatch, k: int) -> None:
    untrained = (
        StructuredArchitecture().proposer("proposals").model
    )  # proposals in random order: the check decides
    for model in (StructuredModel(), untrained, StructuredModel(planner=ExpertPlanner())):
        assert executed(tasks, k, model, seen_by_label(tasks, k)) < 1e-3


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


SCHEDULES = Schedules()


@pytest.fixture(params=range(4))
def sample(request: pytest.FixtureRequest, tasks: TaskBatch) -> Sample:
    return tasks.samples[request.param]


def test_all_classes_hold_the_expert_s_optimum_and_its_checker_agrees(sample: Sample) -> None:
    answer = ClassPlanner(schedules=SCHEDULES)(sample.task)
    assert answer.plan is not None
    assert answer.plan.objective == pytest.approx(sample.plan.objective, rel=2e-3)
    assert check_plan(answer.task, answer.plan).verdict == "sound"


def test_the_expert_as_a_planner_agrees_with_its_labels(tasks: TaskBatch) -> None:
    sample = tasks.samples[0]
    answer = ExpertPlanner()(sample.task)
    assert answer.plan is not None
    assert answer.plan.objective == pytest.approx(sample.plan.objective, rel=2e-3)
