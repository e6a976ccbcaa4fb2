"""What was read keeps what the file said."""

from dataclasses import FrozenInstanceError

import pytest

from expert.files import read_problem, solution_fields, solution_of
from expert.problems.contact import Plan

SLIDE = "configs/problem/contact_trajectory/block_slide_one_finger.yaml"


def test_a_solution_repeats_its_problem_word_for_word() -> None:
    problem = read_problem(SLIDE)
    assert problem.data["description"] == "one finger slides a block along the floor"
    again = solution_of(solution_fields(problem, Plan(status="time_limit")))
    assert again.problem.data == problem.data
    assert again.problem.options == problem.options
    assert again.answer.status == "time_limit"


def test_what_was_read_does_not_change() -> None:
    with pytest.raises(FrozenInstanceError):
        read_problem(SLIDE).kind = "cage"  # type: ignore[misc]
