"""Files of all kinds: every shipped problem is read, and what was made in Python or solved is written so that it reads alike."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from expert.errors import InvalidProblem
from expert.files import (
    FORMATS,
    problem_for,
    problem_of,
    read_problem,
    read_solution,
    solution_fields,
    solution_of,
    write_problem,
    write_solution,
)
from expert.kinds import KINDS
from expert.problems.cage import Arrangement, CageProblem, CageSolution, Meeting
from expert.problems.contact import ContactOptions, Stated
from expert.problems.grasp import GraspProblem, GraspSolution
from expert.world.fingers import Gripper
from expert.world.named import named_shape
from expert.world.shape import Shape
from expert.world.walls import segments
from tests.support.hand_plans import sliding_block
from tests.support.pushes import square_problem
from tests.support.same import assert_same

SHIPPED = sorted(Path("configs/problem").rglob("*.yaml"))
T = Shape(vertices=named_shape("T"))
JAWS = (Gripper(fingers=(0, 1), opening=(0.01, 0.2)), Gripper(fingers=(2, 3), opening=(0.0, 0.1)))
CAGE = CageProblem(
    shape=T,
    pose=np.array([0.1, 0.2, 0.3]),
    count=4,
    fixed=np.array([[0.4, 0.4]]),
    walls=segments([[[-1, -0.5], [1, -0.5]]]),
    grippers=JAWS,
    parallel=True,
    direction=0.7,
    cost="min_separation",
    margin=0.003,
    rotation=((0.2, 0.3), (0.1, 0.1)),
)
GRASP = GraspProblem(
    shape=T, pose=np.array([0, 0.1, -2]), grippers=JAWS, parallel=True, cost="acceleration", margin=0.002
)
STANDING = Arrangement(shape=T, pose=np.zeros(3), fingers=np.array([[0.2, 0.1], [-0.2, 0.1]]))
MADE = {
    "cage": CAGE,
    "arrangement": STANDING,
    "grasp": GRASP,
    "contact": sliding_block()[0],
    "push": square_problem(),
}


def test_there_are_problems_of_every_kind_and_every_kind_can_be_read_and_solved() -> None:
    assert {path.parent.name for path in SHIPPED} == set(FORMATS) == set(KINDS)
    assert len(SHIPPED) > 80


@pytest.mark.parametrize("path", SHIPPED, ids=lambda p: f"{p.parent.name}-{p.stem}")
def test_a_shipped_problem_is_of_its_folder_s_kind_and_survives_writing_and_reading(
    path: Path, tmp_path: Path
) -> None:
    problem = read_problem(path)
    assert problem.kind == path.parent.name
    again = problem_for(problem.task, description="again")
    write_problem(tmp_path / "again.json", again)
    assert_same(read_problem(tmp_path / "again.json").task, problem.task)


@pytest.mark.parametrize("task", MADE.values(), ids=MADE)
def test_a_task_made_in_python_survives_writing_and_reading(task: Any, tmp_path: Path) -> None:
    write_problem(tmp_path / "p.json", problem_for(task))
    assert_same(read_problem(tmp_path / "p.json").task, task)


def test_a_problem_made_in_python_keeps_its_options() -> None:
    problem = problem_for(CAGE, method="model", time_limit=3.0)
    assert problem.options == {"method": "model", "solver": "highs", "time_limit": 3.0}
    assert problem_of(problem.data).options == problem.options
    with pytest.raises(
        InvalidProblem, match=r"options.method: expected swept or model or thesis, got 'magic'"
    ):
        problem_for(CAGE, method="magic")
    with pytest.raises(InvalidProblem, match=r"task: expected ContactTask or CageProblem or .*, got int"):
        problem_for(3)


SLIDING = sliding_block()
ANSWERS = {
    "cage": (
        CAGE,
        CageSolution(
            status="caged",
            fingers=np.arange(8.0).reshape(4, 2),
            rotation_range=(-0.1, 0.2),
            topology=(Meeting(element=0, piece=1, next_element=2, next_piece=3),),
            objective=0.3,
            seconds=1.5,
            attempts=4,
            refuted=1,
            unconfirmed=2,
        ),
    ),
    "turning freely": (
        CAGE,
        CageSolution(status="caged", fingers=np.zeros((4, 2)), rotation_range=(-np.inf, np.inf)),
    ),
    "no cage": (CAGE, CageSolution(status="none_found", reason="of the kind searched for")),
    "grasp": (
        GRASP,
        GraspSolution(status="certified", path=np.arange(40.0).reshape(5, 4, 2), facets=(3, 0, 1, 2), objective=2.0),
    ),
    "no grasp": (GRASP, GraspSolution(status="time_limit")),
    "plan": (SLIDING[0], replace(SLIDING[1], stated=Stated(gap=0.0, asked=ContactOptions.gap))),
}  # fmt: skip


@pytest.mark.parametrize(("task", "answer"), ANSWERS.values(), ids=ANSWERS)
def test_an_answer_survives_writing_and_reading(task: Any, answer: Any, tmp_path: Path) -> None:
    problem = problem_for(task)
    write_solution(tmp_path / "s.json", problem, answer)
    strict = json.loads((tmp_path / "s.json").read_text(), parse_constant=lambda c: pytest.fail(c))
    assert list(strict)[:4] == ["schema", "solution", "problem", "status"]
    again = read_solution(tmp_path / "s.json").answer
    assert solution_fields(problem, again) == strict
    if answer.found and getattr(answer, "rotation_range", None) != (-np.inf, np.inf):
        assert_same(again, answer)


def test_a_solution_needs_its_problem_and_the_same_kind() -> None:
    solution = solution_fields(problem_for(CAGE), CageSolution(status="none_found"))
    for change, complaint in (
        ({"problem": 3}, "problem: expected the whole problem file, got 3"),
        ({"solution": "certified_grasp"}, "solution: expected cage, as its problem"),
        ({"solution": "levitation"}, "solution: expected contact_trajectory or cage or certified_grasp"),
        ({"schema": 2}, "schema: expected 1, got 2"),
        ({"proof": "trust me"}, "proof: .* an unknown key"),
    ):
        with pytest.raises(InvalidProblem, match=f"^{complaint}"):
            solution_of({**solution, **change})
