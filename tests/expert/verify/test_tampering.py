"""No field of a solution file can lie unnoticed: it is refused, the answer is not confirmed, or the report lists it as claimed."""

import copy
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from expert.errors import InvalidProblem
from expert.files import read_problem, solution_fields, solution_of
from expert.kinds import KINDS

ROOT = Path(__file__).resolve().parents[3] / "configs" / "problem"
SOLVED = {
    "contact_trajectory": "contact_trajectory/transverse_rotation_two_fingers.yaml",
    "contact_trajectory on a wall": "contact_trajectory/block_pivot_two_fingers.yaml",
    "no contact_trajectory": "contact_trajectory/block_lift_one_finger_infeasible.yaml",
    "no sequence of contacts": "contact_trajectory/tool_pivot_one_finger.yaml",
    "cage": "cage/m_grippers.yaml",
    "push": "push/box_ellipsoid.yaml",
}
GRASP = {
    "schema": 1,
    "solution": "certified_grasp",
    "problem": {
        "schema": 1,
        "problem": "certified_grasp",
        "object": {"vertices": [[-0.05, -0.03], [0.05, -0.03], [0.05, 0.03], [-0.05, 0.03]]},
        "options": {"half_ranges": [15, 10, 5]},
    },
    "status": "certified",
    "method": "by hand",
    "path": [
        [[0.02, -0.032], [0.052, -0.015], [-0.02, 0.032], [-0.052, 0.015]],
        [[0.02, -0.031], [0.051, -0.015], [-0.02, 0.031], [-0.051, 0.015]],
        [[0.02, -0.030], [0.050, -0.015], [-0.02, 0.030], [-0.050, 0.015]],
    ],
    "facets": [0, 1, 2, 3],
    "starts": [[-0.001, -0.001], [0.001, -0.001], [0.001, 0.001], [-0.001, 0.001]],
    "objective": 4e-6,
    "seconds": 0.5,
    "refuted": 0,
    "reason": "",
}
CONFIRMED = ("sound", "caged", "certified")
WEAKER = {
    ("optimal", "feasible"),  # a plan is a plan
    ("certified", "uncertified"),  # the verdict is about the path
}
"""Statuses that say less than the true one: no lie."""


def lies(key: str, value: Any) -> Iterator[Any]:
    """Values that say something else than the true one."""
    if isinstance(value, bool) or value is None:
        return
    if key == "status":
        statuses = {
            "optimal",
            "feasible",
            "infeasible",
            "time_limit",
            "caged",
            "none_found",
            "certified",
            "uncertified",
            "solved",
            "no_plan",
        }
        yield from sorted(new for new in statuses - {value} if (value, new) not in WEAKER)
    elif key == "rotation_range":
        yield [0.1 * x for x in value]
        yield [x + 0.2 for x in value]
    elif key == "path":  # every one of them is looked at in full
        yield value[::-1]
        yield [*value[:-1], [*value[-1][:-1], [value[-1][-1][0] - 0.02, value[-1][-1][1]]]]
    elif key == "certificate":  # what it proves is looked at in tests/expert/verify/plan/test_optimality.py
        yield {}
        yield {**value, "steps": value["steps"][:-4]}
    elif isinstance(value, str):
        yield value + " "
    elif isinstance(value, int):
        yield value + 1
        yield max(value - 1, 0)
    elif isinstance(value, float):
        yield 20 * value + 1.0
        yield -value - 0.1234
    elif isinstance(value, list):
        yield from _lists(key, value)


def _lists(key: str, value: list[Any]) -> Iterator[Any]:
    if not value:
        return
    yield value[:-1]
    for k in sorted({0, len(value) // 2, len(value) - 1}):
        item = value[k]
        changed = _dicts(item) if isinstance(item, dict) else lies(key, item)
        if item is None:  # a free finger that is said to touch
            changed = iter([0])
        for new in changed:
            yield [*value[:k], new, *value[k + 1 :]]


def _dicts(value: dict[str, Any]) -> Iterator[dict[str, Any]]:
    for key, item in value.items():
        yield from ({**value, key: new} for new in lies(key, item))


@pytest.fixture(scope="module", params=[*SOLVED, "certified_grasp"])
def solution(request: pytest.FixtureRequest) -> dict[str, Any]:
    if request.param == "certified_grasp":
        return GRASP
    problem = read_problem(ROOT / SOLVED[request.param])
    answer = KINDS[problem.kind].solve(problem.task, **problem.options)
    return json.loads(json.dumps(solution_fields(problem, answer)))


def judged(data: dict[str, Any]) -> tuple[str, tuple[str, ...]]:
    """Verdict and what it does not cover; refused files have none."""
    try:
        solution = solution_of(copy.deepcopy(data))
        report = KINDS[solution.problem.kind].verify(solution.problem.task, solution.answer)
    except InvalidProblem:
        return "refused", ()
    return report.verdict, report.claimed


@pytest.mark.slow
def test_no_field_can_lie_unnoticed(solution: dict[str, Any]) -> None:
    assert judged(solution)[0] in CONFIRMED
    unnoticed, told = [], 0
    for key in solution.keys() - {"problem"}:  # the question itself
        for lie in lies(key, solution[key]):
            if lie == solution[key]:
                continue
            told += 1
            verdict, claimed = judged({**solution, key: lie})
            if verdict in CONFIRMED and key not in claimed:
                unnoticed.append((key, str(lie)[:80]))
    assert unnoticed == []
    assert told > 10
