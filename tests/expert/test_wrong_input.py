"""Fifty wrong requests of the command line: each gets one line that names what is wrong, exit code 2, and loses nothing."""

import json
import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from expert.__main__ import main
from expert.files import problem_for, solution_fields
from expert.problems.cage import CageProblem, CageSolution
from expert.problems.grasp import GraspProblem, GraspSolution
from expert.world.shape import Shape
from tests.support.hand_plans import sliding_block

SQUARE = Shape(vertices=np.array([[0, 0], [1, 0], [1, 1], [0, 1]]))
Change = Callable[[dict[str, Any]], object]


def slide() -> dict[str, Any]:
    return solution_fields(problem_for(sliding_block()[0]), sliding_block()[1])


def cage() -> dict[str, Any]:
    task = CageProblem(shape=SQUARE, pose=np.zeros(3), count=2)
    fingers = np.array([[-0.5, 0.5], [1.5, 0.5]])
    return solution_fields(problem_for(task), CageSolution(status="caged", fingers=fingers))


def grasp() -> dict[str, Any]:
    answer = GraspSolution(status="uncertified", path=np.zeros((5, 4, 2)))
    return solution_fields(problem_for(GraspProblem(shape=SQUARE, pose=np.zeros(3))), answer)


def without_plan() -> dict[str, Any]:
    task, plan = sliding_block()
    return solution_fields(problem_for(task), replace(plan, status="time_limit"))


def put(*path: Any) -> Change:
    """Set the place path[:-1] of a mapping to path[-1]."""

    def change(data: dict[str, Any]) -> None:
        here: Any = data
        for key in path[:-2]:
            here = here[key]
        here[path[-2]] = path[-1]

    return change


def drop(*path: Any) -> Change:
    def change(data: dict[str, Any]) -> None:
        here: Any = data
        for key in path[:-1]:
            here = here[key]
        del here[path[-1]]

    return change


PROBLEMS: dict[str, tuple[Callable[[], dict[str, Any]], Change, str]] = {
    "no schema": (slide, drop("problem", "schema"), "schema: expected 1"),
    "schema of the future": (slide, put("problem", "schema", 2), "schema: expected 1, got 2"),
    "unknown kind": (slide, put("problem", "problem", "levitate"), "problem: expected contact_trajectory or"),
    "misspelt key": (slide, put("problem", "objekt", {}), "objekt: .* did you mean object"),
    "no object": (slide, drop("problem", "object"), "object: .* nothing"),
    "list for a section": (slide, put("problem", "fingers", [1]), "fingers: expected a mapping"),
    "negative mass": (slide, put("problem", "object", "mass", -1), "object.mass: expected a positive"),
    "quoted mass": (slide, put("problem", "object", "mass", "1"), "object.mass: .* remove the quotes"),
    "crossing": (slide, put("problem", "object", "vertices", [[0, 0], [1, 1], [1, 0], [0, 1]]), "object.vertices: .* cross"),
    "two corners": (slide, put("problem", "object", "vertices", [[0, 0], [1, 1]]), "object.vertices: "),
    "com outside": (slide, put("problem", "object", "com", [1, 1]), "object.com: "),
    "one pose": (slide, put("problem", "trajectory", "poses", [[0, 0.05, 0]]), "trajectory.poses: .* 2 poses"),
    "pose in the floor": (slide, put("problem", "trajectory", "poses", 1, 1, 0.0), r"trajectory.poses\[1\]: .* inside"),
    "no time": (slide, put("problem", "trajectory", "dt", 0), "trajectory.dt: "),
    "segment as a wall": (slide, put("problem", "environment", "walls", [{"from": [0, 0], "to": [1, 0]}]), r"walls\[0\]: .* yet"),
    "flat normal": (slide, put("problem", "environment", "walls", 0, "normal", [0, 0]), r"walls\[0\].normal: "),
    "half a finger": (slide, put("problem", "fingers", "count", 0.5), "fingers.count: "),
    "no friction": (slide, put("problem", "fingers", "friction", 0), "fingers.friction: "),
    "negative weight": (slide, put("problem", "cost", "force", -1), "cost.force: "),
    "gap of one": (slide, put("problem", "options", {"gap": 1}), "options.gap: "),
    "no patience": (slide, put("problem", "options", {"time_limit": 0}), "options.time_limit: "),
    "no nodes": (slide, put("problem", "options", {"node_limit": 0}), "options.node_limit: "),
    "magic": (slide, put("problem", "options", {"method": "magic"}), "options.method: expected exact or"),
    "finger in the object": (cage, put("problem", "fingers", "fixed", [[0.5, 0.5]]), r"fingers.fixed\[0\]: .* inside"),
    "one finger": (cage, put("problem", "fingers", "count", 1), "fingers: expected at least 2"),
    "both": (cage, put("problem", "fingers", "positions", [[2, 2], [3, 3]]), "fingers.count: .* beside positions"),
    "half-plane as a wall": (cage, put("problem", "walls", [{"point": [0, -1], "normal": [0, 1]}]), r"walls\[0\]: .* yet"),
    "hole": (cage, put("problem", "object", {"pieces": [[[0, 0], [3, 0], [3, 1], [0, 1]], [[0, 2], [3, 2], [3, 3], [0, 3]], [[0, 0], [1, 0], [1, 3], [0, 3]], [[2, 0], [3, 0], [3, 3], [2, 3]]]}), "object.pieces: .* hole"),
    "tight jaws": (cage, put("problem", "fingers", "grippers", [{"fingers": [0, 1], "opening": [2, 1]}]), "grippers.opening: "),
    "direction of nothing": (cage, put("problem", "fingers", "direction", 10), "fingers.direction: "),
    "whole turn": (cage, put("problem", "options", "rotation", [180]), "options.rotation: "),
    "five fingers": (grasp, put("problem", "fingers", "count", 5), "fingers.count: expected 3 or 4"),
    "increasing": (grasp, put("problem", "options", "half_ranges", [1, 2]), "options.half_ranges: "),
    "beauty": (grasp, put("problem", "cost", "beauty"), "cost: expected attraction or acceleration"),
}  # fmt: skip
SOLUTIONS: dict[str, tuple[Callable[[], dict[str, Any]], Change, str]] = {
    "no problem": (slide, put("problem", None), "problem: expected the whole problem file"),
    "another kind": (slide, put("solution", "cage"), "solution: expected contact_trajectory, as its problem"),
    "perfect": (slide, put("status", "perfect"), "status: "),
    "a finger missing": (slide, put("finger_positions", 0, []), r"finger_positions\[0\]: "),
    "mode of no facet": (slide, put("modes", 0, 0, 9), r"modes\[0\]: "),
    "wall of none": (slide, put("contact_forces", 0, "wall", 7), r"contact_forces\[0\].wall: "),
    "cage without fingers": (cage, drop("fingers"), "fingers: "),
    "no cage": (cage, put("status", "none_found"), "status: expected caged, got none_found"),
    "a knot missing": (grasp, put("path", []), "path: "),
    "proof": (grasp, put("proof", "trust me"), "proof: .* unknown key"),
}  # fmt: skip


@pytest.fixture
def folder(tmp_path: Path) -> Iterator[Path]:
    """A folder with a precious file, which must be there in the end, alone but for the input."""
    (tmp_path / "precious.json").write_text("precious")
    yield tmp_path
    assert (tmp_path / "precious.json").read_text() == "precious"
    assert {path.name for path in tmp_path.iterdir()} <= {"precious.json", "input.json", "input.yaml"}


def refusal(arguments: list[Any], capsys: pytest.CaptureFixture[str]) -> str:
    """The line that the command says, with exit code 2 and nothing on standard output."""
    try:
        code = main([str(argument) for argument in arguments])
    except SystemExit as ended:  # of the parser of command lines
        code = ended.code  # type: ignore[assignment]
    said = capsys.readouterr()
    assert (code, said.out) == (2, "")
    (line,) = said.err.splitlines()
    assert line.startswith("error: ")
    assert len(line) < 1000
    return line


@pytest.mark.parametrize(("made", "change", "complaint"), PROBLEMS.values(), ids=PROBLEMS)
def test_a_wrong_problem(
    made: Callable[[], dict[str, Any]], change: Change, complaint: str, folder: Path, capsys: Any
) -> None:
    data = made()
    change(data)
    (folder / "input.yaml").write_text(yaml.safe_dump(data["problem"]))
    line = refusal(["solve", folder / "input.yaml", "-o", folder / "precious.json"], capsys)
    assert re.search(f"input.yaml: .*{complaint}", line), line


@pytest.mark.parametrize(("made", "change", "complaint"), SOLUTIONS.values(), ids=SOLUTIONS)
def test_a_wrong_solution(
    made: Callable[[], dict[str, Any]], change: Change, complaint: str, folder: Path, capsys: Any
) -> None:
    data = made()
    change(data)
    (folder / "input.json").write_text(json.dumps(data))
    line = refusal(["verify", folder / "input.json", "-o", folder / "precious.json"], capsys)
    assert re.search(f"input.json: .*{complaint}", line), line


REQUESTS: dict[str, tuple[list[str], str]] = {
    "no file": (["solve", "{}/absent.yaml", "-o", "{}/precious.json"], "readable file"),
    "a folder": (["verify", "{}", "-o", "{}/precious.json"], "readable file"),
    "a long name": (["verify", "{}/" + 300 * "x", "-o", "{}/precious.json"], "readable file"),
    "output over input": (["verify", "{}/input.json", "-o", "{}/input.json"], "another file than the input"),
    "no such folder": (["solve", "{}/input.yaml", "-o", "{}/absent/s.json"], "create the folder"),
    "a long output": (["solve", "{}/input.yaml", "-o", "{}/" + 300 * "x"], "File name too long"),
    "a device": (["solve", "{}/input.yaml", "-o", "/dev/null"], "may be replaced"),
    "magic": (["solve", "{}/input.yaml", "--method", "magic"], "options.method: expected exact or thesis"),
    "solving a solution": (["solve", "{}/input.json", "-o", "{}/precious.json"], "problem: expected"),
    "checking a problem": (["verify", "{}/input.yaml"], "solve it first"),
    "drawing a problem": (["draw", "{}/input.yaml", "-o", "{}/a.png"], "solve it first"),
    "a strange picture": (["draw", "{}/input.json", "-o", "{}/a.bmp"], "a name that ends in .png"),
    "a view of no cage": (["draw", "{}/input.json", "-o", "{}/a.png", "--view", "slice"], "view: expected none"),
    "no picture": (["draw", "{}/input.json"], "required: -o/--output"),
    "no command": ([], "required"),
    "another command": (["levitate", "x.yaml"], "invalid choice: 'levitate'"),
    "another option": (["solve", "{}/input.yaml", "--fast"], "unrecognized arguments: --fast"),
}  # fmt: skip


@pytest.mark.parametrize(("arguments", "complaint"), REQUESTS.values(), ids=REQUESTS)
def test_a_wrong_request(arguments: list[str], complaint: str, folder: Path, capsys: Any) -> None:
    (folder / "input.json").write_text(json.dumps(slide()))
    (folder / "input.yaml").write_text(yaml.safe_dump(slide()["problem"]))
    line = refusal([argument.replace("{}", str(folder)) for argument in arguments], capsys)
    assert complaint in line


def test_there_are_fifty_of_them() -> None:
    assert len(PROBLEMS) + len(SOLUTIONS) + len(REQUESTS) >= 50
