"""Cases in Python are what their files are: keys, defaults, refusals and answers."""

import inspect
import sys
from pathlib import Path

import numpy as np
import pytest

import certmanip
from certmanip.cases import Case, cage, case, certified_grasp, contact_trajectory, load, push
from expert.errors import InvalidProblem
from expert.files import FORMATS, read_problem, read_solution, write_problem
from expert.problems.cage import Arrangement
from expert.problems.contact import Cost
from expert.shipped import CONFIGS
from expert.world.fingers import Fingers, Gripper
from expert.world.named import named_shape
from expert.world.shape import Body, Shape
from expert.world.walls import HalfPlane, Segment

SQUARE = 0.05 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
BUILDERS = {
    "contact_trajectory": contact_trajectory,
    "cage": cage,
    "certified_grasp": certified_grasp,
    "push": push,
}
SLIDE = CONFIGS / "problem/contact_trajectory/block_slide_one_finger.yaml"


@pytest.mark.parametrize("kind", BUILDERS)
def test_a_builder_has_the_sections_of_the_file_and_no_other(kind: str) -> None:
    assert set(inspect.signature(BUILDERS[kind]).parameters) == set(FORMATS[kind].KEYS)


def test_every_kind_has_a_builder() -> None:
    assert BUILDERS.keys() == FORMATS.keys()


@pytest.mark.parametrize("name", ["contact_trajectory/block_slide_one_finger", "cage/t_grippers", "certified_grasp/t", "push/round_the_wall"])  # fmt: skip
def test_a_case_of_a_file_s_sections_is_the_file_s_problem(name: str) -> None:
    file = read_problem(CONFIGS / "problem" / f"{name}.yaml")
    sections = {key: file.data[key] for key in FORMATS[file.kind].KEYS if key in file.data}
    built = BUILDERS[file.kind](**sections).problem
    assert built.options == file.options
    assert FORMATS[file.kind].write(built.task) == FORMATS[file.kind].write(file.task)


def test_nouns_and_arrays_stand_for_sections() -> None:
    body, _ = Body.uniform(SQUARE, 0.1)
    floor = HalfPlane(point=np.zeros(2), normal=np.array([0.0, 1.0]), friction=0.1)
    fingers = Fingers(count=1, friction=0.2, max_force=10.0)
    poses = np.array([[0, 0.05, 0], [0.005, 0.05, 0]])
    built = contact_trajectory(
        object=body,
        environment={"walls": (floor,)},
        trajectory={"dt": np.float64(0.1), "poses": poses},
        fingers=fingers,
        cost=Cost(margin=0.5),
    ).task
    assert built.fingers == fingers
    assert built.cost.margin == 0.5
    assert built.body.mass == 0.1
    assert built.environment.walls[0].friction == 0.1
    np.testing.assert_array_equal(built.trajectory.poses, poses)
    wall = Segment(ends=[[-0.1, 0.06], [0.1, 0.06]])
    jaws = Gripper(fingers=(0, 1), opening=(0.0, 0.2))
    caged = cage(object=Shape(vertices=SQUARE), walls=[wall], fingers={"count": 2, "grippers": [jaws]}).task
    assert caged.grippers == (jaws,)
    np.testing.assert_array_equal(caged.walls[0].ends, wall.ends)


def test_an_answer_is_verified_drawn_saved_and_loaded(tmp_path: Path) -> None:
    solved = load("shipped:cage/t_4").solve(time_limit=30)
    assert (solved.status, solved.verify().verdict) == ("caged", "caged")
    assert solved.problem.options["time_limit"] == 30
    solved.draw(tmp_path / "cage.png")
    assert (tmp_path / "cage.png").stat().st_size > 1000
    solved.save(tmp_path / "cage.json")
    np.testing.assert_array_equal(read_solution(tmp_path / "cage.json").answer.fingers, solved.answer.fingers)
    again = load(tmp_path / "cage.json")
    assert again.status == "caged"
    assert again.verify().verdict == "caged"


def test_a_problem_is_saved_and_loaded_as_such(tmp_path: Path) -> None:
    asked = cage(object=named_shape("T"), fingers={"count": 4}, options={"margin": 0.003})
    assert asked.status == "open"
    asked.save(tmp_path / "problem.json")
    assert load(tmp_path / "problem.json").task.margin == 0.003


def test_solving_changes_no_case() -> None:
    asked = load("shipped:cage/t_4")
    before = asked.problem
    assert asked.solve(method="swept").answer is not None
    assert (asked.answer, asked.problem) == (None, before)


def test_given_fingers_are_verified_and_not_searched_for() -> None:
    around = 0.055 * np.array([[-1, 0], [0, -1], [1, 0], [0, 1]])
    stated = cage(object=SQUARE, fingers={"positions": around})
    assert (stated.status, stated.verify().verdict) == ("stated", "caged")
    assert cage(object=SQUARE, fingers={"positions": around[:3]}).verify().verdict == "escapes"
    with pytest.raises(InvalidProblem, match="verify it instead"):
        stated.solve()


def test_a_task_of_nouns_is_a_case(tmp_path: Path) -> None:
    around = Arrangement(shape=Shape(vertices=SQUARE), pose=np.zeros(3), fingers=2 * SQUARE)
    made = case(around)
    assert (made.kind, made.status) == ("cage", "stated")
    write_problem(tmp_path / "a.json", made.problem)
    assert load(tmp_path / "a.json").status == "stated"


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: cage(object=SQUARE, fingers={"cont": 4}), r"fingers\.cont: .*did you mean count\?"),
        (lambda: cage(object=SQUARE[:2], fingers={"count": 4}), r"object\.vertices: "),
        (lambda: load("shipped:cage/t_4").solve(time_limit=-1), r"options\.time_limit: "),
        (lambda: load("shipped:cage/t_4").solve(limit=1), r"options\.limit: .*unknown key"),
        (lambda: load("nowhere.json"), "No such file"),
        (lambda: case(3), "task: expected ContactTask"),
        (lambda: load("shipped:cage/t_4").verify(), "solve it first"),
    ],
)
def test_what_is_wrong_is_one_line(call, words: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(InvalidProblem, match=words) as refusal:
        call()
    assert "\n" not in str(refusal.value)


def test_a_case_names_itself_briefly() -> None:
    assert repr(load(SLIDE)) == "<contact_trajectory: open>"
    assert isinstance(load(SLIDE), Case)
    assert "certmanip" in sys.modules
    assert certmanip.load is load
