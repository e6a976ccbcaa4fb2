from dataclasses import replace

import numpy as np

from datasets.label import Labelling, Refusal, label
from datasets.motions import TaskSettings, sample_task
from datasets.shapes import Shapes
from datasets.specification import Specification, draw
from expert.contact import solve
from expert.verify.plan.check import check_plan


def test_a_spent_budget_is_no_proof_of_infeasibility() -> None:
    task = sample_task(
        np.random.default_rng(0), "slide_lift", Shapes(facets=(12, 12)), TaskSettings(least_push=0.0)
    )
    answer = label(task, Labelling(node_limit=1, gap=1e-9))
    reason = answer.reason if isinstance(answer, Refusal) else answer.plan.status
    assert reason in ("budget", "feasible")


def test_the_least_push_is_given_up_only_where_no_plan_keeps_it(smoke: Specification) -> None:
    """With fingers that may push with 0.9 to 1 m g alone, slides have plans, and some lifts need a gentler touch."""
    strict = replace(smoke, tasks=replace(smoke.tasks, least_push=0.9, force_limit=1.0))
    kept, given_up = [], []
    for index in (0, 5, 6, 10):
        sample, _ = draw(strict, 0, index)
        assert check_plan(sample.task, sample.plan).verdict == "sound"
        (kept if sample.task.robustness.min_normal_force > 0 else given_up).append(sample)
    assert kept
    assert given_up
    for sample in given_up:
        asked = replace(sample.task.robustness, min_normal_force=0.9 * sample.task.weight)
        assert solve(replace(sample.task, robustness=asked)).status == "infeasible"
