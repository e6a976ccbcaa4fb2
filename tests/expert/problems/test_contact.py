"""The contact task, its options and its answer."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from expert.errors import InvalidProblem
from expert.problems.contact import ContactOptions, Cost, Plan, Robustness
from tests.support.hand_plans import sliding_block


def test_an_object_inside_a_wall_is_refused_and_one_that_touches_is_not() -> None:
    task, _ = sliding_block()
    tolerance = task.contact_tolerance
    path = task.trajectory
    for depth, accepted in ((0.0, True), (1.9 * tolerance, True), (2.1 * tolerance, False)):
        lowered = replace(path, poses=path.poses - [0, depth, 0])
        if accepted:
            assert replace(task, trajectory=lowered).steps == 5
        else:
            with pytest.raises(InvalidProblem, match=r"trajectory.poses\[0\]: .* free side of wall 0"):
                replace(task, trajectory=lowered)


def test_weight_and_tolerance_follow_the_body() -> None:
    task, _ = sliding_block()
    assert task.weight == pytest.approx(task.body.mass * 9.8)
    assert task.contact_tolerance == pytest.approx(1e-5 * task.body.size)


def test_the_gap_of_a_plan_is_relative_and_missing_without_one() -> None:
    assert Plan(status="optimal", objective=2.0, bound=1.9).gap == pytest.approx(0.05)
    assert np.isnan(Plan(status="infeasible").gap)
    assert [Plan(status=s).found for s in ("optimal", "feasible", "infeasible", "time_limit")] == [True, True, False, False]  # type: ignore[arg-type] # fmt: skip


@pytest.mark.parametrize(
    ("noun", "fields", "complaint"),
    [
        (Cost, {"force": -1}, "cost.force"),
        (Cost, {"margin": np.inf}, "cost.margin"),
        (Robustness, {"cone_fraction": 0}, "robustness.cone_fraction"),
        (Robustness, {"support_inset": 0.5}, "robustness.support_inset"),
        (Robustness, {"min_normal_force": -1}, "robustness.min_normal_force"),
        (Robustness, {"min_interval": 3}, "robustness.min_interval"),
        (Robustness, {"free_clearance": np.nan}, "robustness.free_clearance"),
        (ContactOptions, {"gap": 1.0}, "options.gap"),
        (ContactOptions, {"time_limit": 0}, "options.time_limit"),
        (ContactOptions, {"node_limit": 0}, "options.node_limit"),
    ],
)
def test_impossible_values_are_refused(noun: Any, fields: dict[str, Any], complaint: str) -> None:
    noun()
    with pytest.raises(InvalidProblem, match=f"^{complaint}: "):
        noun(**fields)
