"""Pictures of cages and escapes, through the command line, from files."""

import re
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from expert.__main__ import main
from expert.drawing.cage import draw
from expert.drawing.cage_component import linked_slices
from expert.drawing.cage_slice import enclosing_loop
from expert.errors import InvalidProblem
from expert.files import read_problem
from expert.geometry.polygon import facet_frames, facets
from expert.geometry.pose import to_world
from expert.problems.cage import Arrangement
from expert.world.named import named_shape
from expert.world.shape import Shape
from expert.world.slices import free_components, obstacles_at
from tests.support.polygons import random_polygon

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


@pytest.mark.parametrize("view", ["workspace", "slice", "component"])
def test_each_view_is_drawn_alone_from_a_problem_file_with_given_fingers(view: str, tmp_path: Path) -> None:
    picture = tmp_path / "view.png"
    assert main(["draw", str(PROBLEMS / "i_given.yaml"), "--view", view, "-o", str(picture)]) == 0
    with Image.open(picture) as image:
        assert image.size == (420, 400)
        colours = np.unique(np.asarray(image.convert("RGB")).reshape(-1, 3), axis=0)
    assert len(colours) > 50


def test_an_unknown_view_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    picture = tmp_path / "view.png"
    assert main(["draw", str(PROBLEMS / "i_given.yaml"), "--view", "inside", "-o", str(picture)]) == 2
    assert "view: expected all or workspace or slice or component, got inside" in capsys.readouterr().err
    assert not picture.exists()


@given(st.integers(0, 10**6), st.floats(-3, 3))
@settings(max_examples=20, deadline=None, derandomize=True)
def test_the_drawn_loop_stays_in_obstacles_and_winds_once_around_the_start(seed: int, angle: float) -> None:
    """Fingers close to the facets of a polygon leave it little room at its orientation."""
    shape = Shape(vertices=random_polygon(np.random.default_rng(seed), 5))
    a, b = facets(shape.vertices)
    inward, _ = facet_frames(shape.vertices)
    beside = (a + b) / 2 - 0.01 * shape.size * inward
    pose = np.array([0.1, 0.0, angle])
    cage = Arrangement(shape=shape, pose=pose, fingers=to_world(pose, beside))
    obstacles = obstacles_at(cage.shape, cage.fingers, cage.wall_ends, angle)
    (component,) = (
        p
        for p in free_components(cage.shape, cage.fingers, cage.wall_ends, angle)
        if p.covers(shapely.Point(0.1, 0))
    )
    loop = enclosing_loop(component, obstacles)
    assert shapely.union_all(obstacles).buffer(1e-9).covers(shapely.LineString(loop))
    assert shapely.Polygon(loop).area > 1.05 * component.area
    angles = np.unwrap(np.arctan2(*(loop - pose[:2]).T[::-1]))
    assert abs(angles[-1] - angles[0]) == pytest.approx(2 * np.pi)


def test_linked_slices_leave_out_what_the_start_cannot_reach() -> None:
    a = arrangement("I", [[-0.02, 0], [0.02, 0]])
    angles = np.radians(np.linspace(-20, 20, 9))
    reached = linked_slices(a, angles)
    assert all(len(parts) == 1 for parts in reached)
    assert reached[4][0].covers(shapely.Point(0, 0))


def test_the_gallery_shows_what_make_figures_draws() -> None:
    page = Path("docs/gallery.md").read_text()
    listed = re.search(r"^CAGES := ((?:.|\\\n)*?)$(?<!\\)", Path("Makefile").read_text(), flags=re.MULTILINE)
    assert listed
    names = set(listed[1].replace("\\\n", " ").split())
    assert names == set(re.findall(r"\(gallery/cage_(\w+)\.png\)", page))
    for name in names:
        assert (PROBLEMS / f"{name}.yaml").exists()
        assert Path(f"docs/gallery/cage_{name}.png").stat().st_size < 100_000
