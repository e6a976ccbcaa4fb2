"""python -m dlm.simulator on solution files."""

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from dlm.simulator.__main__ import main
from expert.contact import solve
from expert.files import read_problem, write_solution

PROBLEMS = Path("configs/problem/contact_trajectory")


def solved(name, folder):
    problem = read_problem(PROBLEMS / f"{name}.yaml")
    write_solution(folder / "solution.json", problem, solve(problem.task, **problem.options))
    return folder / "solution.json"


@pytest.fixture(scope="module")
def solution(tmp_path_factory):
    return solved("twelve_facets_lift_two_fingers", tmp_path_factory.mktemp("plans"))


def test_a_robust_plan_reaches_its_goal_in_both_engines(solution, tmp_path, capsys):
    pytest.importorskip("mujoco")
    files = {"--json": tmp_path / "r.json", "--mjcf": tmp_path / "plan.xml", "-o": tmp_path / "strip.png"}
    arguments = [str(solution), "--mujoco", *(str(x) for pair in files.items() for x in pair)]
    assert main(arguments) == 0
    result = json.loads(files["--json"].read_text())
    assert result["simulator"]["final_mm"] < 1
    ours, theirs = (np.array(result[engine]["poses"][-1]) for engine in ("simulator", "mujoco"))
    assert np.abs(ours - theirs)[:2].max() < 1e-4
    assert abs(ours[2] - theirs[2]) < np.radians(
        0.1
    )  # at half its step MuJoCo turns by some hundredths of a degree
    assert files["--mjcf"].read_text().startswith("<mujoco")
    with Image.open(files["-o"]) as strip:
        assert strip.size[0] > 500
    assert "simulator: ends" in capsys.readouterr().out


def test_an_animation_shows_the_motion(solution, tmp_path):
    out = tmp_path / "lift.gif"
    assert main([str(solution), "-o", str(out)]) == 0
    with Image.open(out) as movie:
        assert movie.n_frames > 20


def test_a_squeeze_without_margins_drops_the_block_and_says_so(tmp_path, capsys):
    """Its forces lie on the edges of the friction cones, and no open loop survives that."""
    assert main([str(solved("block_lift_two_fingers", tmp_path))]) == 1
    assert "70.000 mm" in capsys.readouterr().out


@pytest.mark.parametrize("text", ["{}", "not json", '{"schema": 1, "solution": "contact-trajectory"}'])
def test_a_bad_file_is_one_line_and_exit_code_2(tmp_path, capsys, text):
    bad = tmp_path / "bad.json"
    bad.write_text(text)
    assert main([str(bad)]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert str(bad) in error


def test_a_missing_file_is_one_line_and_exit_code_2(tmp_path, capsys):
    assert main([str(tmp_path / "none.json")]) == 2
    assert capsys.readouterr().err.count("\n") == 1
