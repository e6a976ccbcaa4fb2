"""Pictures of cages and escapes, through the command line, from files."""

import itertools
import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from expert.__main__ import main
from expert.drawing.cage import VIEWS, cage_figure, draw
from expert.drawing.canvas import pixels
from expert.drawing.marks import FINGER, FREE, OBJECT
from expert.errors import InvalidProblem
from expert.files import read_problem
from expert.problems.cage import Arrangement
from expert.verify.cage.check import verify_cage
from expert.world.named import named_shape
from expert.world.shape import Shape
from tests.support.pictures import coloured, frames_of, texts

PROBLEMS = Path("configs/problem/cage")


def arrangement(name: str, fingers: list) -> Arrangement:
    return Arrangement(shape=Shape(vertices=named_shape(name)), pose=np.zeros(3), fingers=np.array(fingers))


def test_a_cage_is_drawn_in_three_panels_under_its_verdict() -> None:
    cage = arrangement("I", [[-0.02, 0], [0.02, 0]])
    figure = cage_figure(cage, cage, verify_cage(cage), VIEWS)
    words = texts(figure)
    assert re.fullmatch(r"caged: it can turn from -[0-9.]+° to [0-9.]+°, and never leaves", words[0])
    assert {"workspace", "configuration space at θ = 0°", "all that the object can reach"} <= set(words)
    assert {"object", "finger, one colour each", "obstacle of a finger", "free around the start"} <= set(
        words
    )
    image = pixels(figure)
    thirds = np.array_split(coloured(image[60:-60], FREE), 3, axis=1)
    assert [bool(third.any()) for third in thirds] == [False, True, False]


def test_an_escape_is_animated_and_a_cage_is_not(tmp_path: Path) -> None:
    draw(arrangement("I", [[-0.02, 0], [0.08, 0]]), None, tmp_path / "escape.gif")
    frames = frames_of(tmp_path / "escape.gif")
    assert len(frames) > 8
    panel = slice(50, -60)
    places = [np.argwhere(coloured(frame[panel], OBJECT)).mean(axis=0) for frame in frames]
    assert all((a != b).any() for a, b in itertools.pairwise(places[:-1]))
    fingers = [np.argwhere(coloured(frame[panel], FINGER)).mean(axis=0) for frame in (frames[0], frames[-1])]
    np.testing.assert_allclose(fingers[0], fingers[1], atol=1.5)
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


@pytest.mark.parametrize("view", ["workspace", "slice", "component"])
def test_each_view_is_drawn_alone_from_a_problem_file_with_given_fingers(view: str, tmp_path: Path) -> None:
    picture = tmp_path / "view.png"
    assert main(["draw", str(PROBLEMS / "i_given.yaml"), "--view", view, "-o", str(picture)]) == 0
    with Image.open(picture) as image:
        shown = np.asarray(image.convert("RGB"))
    wanted = {"workspace": OBJECT, "slice": FREE, "component": "#21918c"}[view]
    assert coloured(shown[40:-60], wanted, 40).sum() > 20
    absent = {"workspace": FREE, "slice": OBJECT, "component": OBJECT}[view]
    assert coloured(shown[40:-60], absent, 4).sum() == 0


def test_an_unknown_view_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    picture = tmp_path / "view.png"
    assert main(["draw", str(PROBLEMS / "i_given.yaml"), "--view", "inside", "-o", str(picture)]) == 2
    assert "view: expected all or workspace or slice or component, got inside" in capsys.readouterr().err
    assert not picture.exists()


def test_the_gallery_shows_what_make_figures_draws() -> None:
    page = Path("docs/gallery.md").read_text()
    listed = re.search(r"^CAGES := ((?:.|\\\n)*?)$(?<!\\)", Path("Makefile").read_text(), flags=re.MULTILINE)
    assert listed
    names = set(listed[1].replace("\\\n", " ").split())
    assert names == set(re.findall(r"\(gallery/cage_(\w+)\.png\)", page))
    for name in names:
        assert (PROBLEMS / f"{name}.yaml").exists()
        (picture,) = frames_of(Path(f"docs/gallery/cage_{name}.png"))
        workspace, space, _ = np.array_split(picture, 3, axis=1)
        assert coloured(workspace, OBJECT, 30).mean() > 0.05
        assert coloured(workspace, FINGER, 40).sum() > 20
        assert coloured(space, FREE, 40).sum() > 20
