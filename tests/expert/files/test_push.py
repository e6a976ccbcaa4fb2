import copy

import numpy as np
import pytest

from expert.errors import InvalidProblem
from expert.files import problem_for, problem_of, read_problem, read_solution, solution_of, write_solution
from expert.problems.push import Finger, LimitSurface, Tolerance
from expert.world.walls import Obstacle
from tests.support.pushes import square_problem, straight_push
from tests.support.same import assert_same

FULL = square_problem(
    limit_surface=LimitSurface(kind="uniform"),
    finger=Finger(start=np.array([-0.1, 0]), radius=0.0, friction=0.1, push_speed=0.02, travel_speed=0.3),
    tolerance=Tolerance(position=0.001, angle=0.02),
    obstacles=(Obstacle(vertices=np.array([[0.2, 0.2], [0.3, 0.2], [0.25, 0.3]]), name="obstacles[0]"),),
    workspace=np.array([-0.4, -0.4, 0.4, 0.4]),
    clearance=0.003,
)


def test_every_key_survives_writing_and_reading():
    problem = problem_for(FULL, time_limit=5, depth=3, width=20)
    assert_same(problem_of(problem.data).task, FULL)
    assert problem.options == {"method": "table", "time_limit": 5.0, "depth": 3, "width": 20}


def test_a_plan_survives_writing_and_reading(tmp_path):
    problem = problem_for(square_problem())
    write_solution(tmp_path / "s.json", problem, straight_push())
    read = read_solution(tmp_path / "s.json")
    assert_same(read.answer, straight_push())
    assert_same(read.problem.task, square_problem())


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"finger": {"radius": 0.01}}, "finger.start: expected"),
        ({"finger": {"start": [-0.1, 0], "raduis": 0.01}}, "finger.raduis: .* did you mean radius"),
        ({"limit_surface": {"kind": "sphere"}}, "limit_surface.kind: expected uniform or ellipsoid"),
        ({"obstacles": [{"point": [0, 0], "normal": [0, 1]}]}, r"obstacles\[0\]: expected a polygon"),
        ({"goal": [9, 0, 0], "workspace": [-1, -1, 1, 1]}, "goal: expected a pose"),
        ({"options": {"method": "magic"}}, "options.method: expected table"),
        ({"gaol": [0, 0, 0]}, "gaol: .* did you mean goal"),
    ],
)
def test_bad_files_are_refused_in_one_line(change, complaint):
    data = problem_for(square_problem()).data | change
    with pytest.raises(InvalidProblem, match=complaint) as refusal:
        problem_of(data)
    assert "\n" not in str(refusal.value)


def test_a_solution_with_a_broken_push_is_refused(tmp_path):
    problem = problem_for(square_problem())
    write_solution(tmp_path / "s.json", problem, straight_push())
    whole = read_solution(tmp_path / "s.json").problem.data
    fields = {"status": "solved", "objective": 1.0, "seconds": 0.0, "nodes": 0, "reason": ""}
    push = {"way": [[0, 0]], "end": [0, 0], "pose": [0, 0, 0]}
    data = {"schema": 1, "solution": "push", "problem": whole, **fields}
    assert len(solution_of({**data, "pushes": [push]}).answer.pushes) == 1
    for key, value in (("way", []), ("end", [0]), ("pose", [0, 0])):
        with pytest.raises(InvalidProblem):
            solution_of({**copy.deepcopy(data), "pushes": [{**push, key: value}]})


def test_shipped_problems_differ_in_what_they_ask():
    kinds = {
        read_problem(f"configs/problem/push/{n}.yaml").task.limit_surface.kind
        for n in ("tee", "box_ellipsoid")
    }
    assert kinds == {"uniform", "ellipsoid"}
