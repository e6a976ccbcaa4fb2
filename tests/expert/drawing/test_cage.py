"""Pictures of cages and escapes, through the command line, from files."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from expert.__main__ import main
from expert.caging.problem import Arrangement, Shape
from expert.caging.shapes import named_shape
from expert.drawing.cage import draw
from expert.errors import InvalidProblem
from expert.files import read_problem

PROBLEMS = Path("configs/problem/cage")


def arrangement(name: str, fingers: list) -> Arrangement:
    return Arrangement(shape=Shape(vertices=named_shape(name)), pose=np.zeros(3), fingers=np.array(fingers))


def test_a_cage_is_drawn_in_three_panels(tmp_path: Path) -> None:
    draw(arrangement("I", [[-0.02, 0], [0.02, 0]]), None, tmp_path / "cage.png")
    image = np.asarray(Image.open(tmp_path / "cage.png").convert("RGB")).astype(int)
    assert image.shape[1] > 2 * image.shape[0]
    third = image.shape[1] // 3
    blue = (image[..., 2] - image[..., 0]) > 60
    assert [bool(blue[:, k * third : (k + 1) * third].any()) for k in range(3)] == [False, True, True]


def test_an_escape_is_animated_and_a_cage_is_not(tmp_path: Path) -> None:
    draw(arrangement("I", [[-0.02, 0], [0.08, 0]]), None, tmp_path / "escape.gif")
    with Image.open(tmp_path / "escape.gif") as film:
        assert film.n_frames > 8  # type: ignore[attr-defined]
    with pytest.raises(InvalidProblem, match="still picture"):
        draw(arrangement("I", [[-0.02, 0], [0.02, 0]]), None, tmp_path / "cage.gif")


@pytest.mark.parametrize(("name", "code", "word"), [("i_given", 0, "caged"), ("hooks_given", 1, "escapes")])
def test_given_fingers_are_verified_from_files(
    name: str, code: int, word: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["verify", str(PROBLEMS / f"{name}.yaml"), "-o", str(tmp_path / "report.json")]) == code
    assert word in capsys.readouterr().out
    assert word in (tmp_path / "report.json").read_text()


def test_solve_verify_and_draw_a_file(tmp_path: Path) -> None:
    solution = tmp_path / "cage.json"
    assert main(["solve", str(PROBLEMS / "random_00.yaml"), "-o", str(solution)]) == 0
    assert main(["verify", str(solution)]) == 0
    assert main(["draw", str(solution), "-o", str(tmp_path / "cage.png")]) == 0


@pytest.mark.parametrize("path", sorted(PROBLEMS.glob("*.yaml")), ids=lambda p: p.stem)
def test_every_problem_file_is_read(path: Path) -> None:
    assert read_problem(path).kind == "cage"
