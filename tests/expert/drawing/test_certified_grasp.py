"""Pictures of certified grasps exist, show what they say, and are refused where there is nothing to show."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from expert.drawing.certified_grasp import draw, executions, grasp_figure
from expert.drawing.grasp_figures import force_closure_comparison, main, pose_errors, start_area
from expert.errors import InvalidProblem
from expert.problems.grasp import GraspProblem, GraspSolution
from expert.world.shape import Shape

CORNERS = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
TASK = GraspProblem(shape=Shape(vertices=0.05 * CORNERS), pose=np.array([0.02, 0.0, 0.0]))
CONTACTS = np.array([[0.015, -0.05], [0.05, -0.015], [-0.015, 0.05], [-0.05, 0.015]]) + TASK.pose[:2]
OUTWARD = np.array([[0, -1], [1, 0], [0, 1], [-1, 0]])
ANSWER = GraspSolution(
    status="uncertified",
    path=np.stack([CONTACTS + d * OUTWARD for d in (0.008, 0.006, 0.004, 0.002, 0.0)]),
)


def test_a_picture_shows_all_runs_and_where_they_end() -> None:
    runs = executions(TASK, ANSWER, 10)
    figure = grasp_figure(TASK, ANSWER, runs)
    assert figure.get_suptitle().startswith("10 random starts end within")
    assert len(figure.axes) == 3 + len(ANSWER.path)
    assert "jam" not in figure.get_suptitle()


def test_executions_are_the_same_each_time() -> None:
    np.testing.assert_array_equal(executions(TASK, ANSWER, 5).poses, executions(TASK, ANSWER, 5).poses)


def test_pictures_and_animations_are_written(tmp_path: Path) -> None:
    draw(TASK, ANSWER, tmp_path / "a.png")
    draw(TASK, ANSWER, tmp_path / "a.gif")
    with Image.open(tmp_path / "a.png") as image:
        assert np.asarray(image.convert("L")).std() > 10
    with Image.open(tmp_path / "a.gif") as image:
        assert getattr(image, "n_frames", 1) > 20
    assert (tmp_path / "a.gif").stat().st_size < 500_000


def test_nothing_is_drawn_without_fingers_or_without_a_cage(tmp_path: Path) -> None:
    with pytest.raises(InvalidProblem, match="solve it first"):
        draw(TASK, GraspSolution(status="none_found"), tmp_path / "a.png")
    far = GraspSolution(status="uncertified", path=ANSWER.path + 3 * (ANSWER.path - TASK.pose[:2]))
    with pytest.raises(InvalidProblem, match="cage the goal"):
        draw(TASK, far, tmp_path / "a.png")
    assert list(tmp_path.iterdir()) == []


def test_the_start_area_is_that_of_the_slice() -> None:
    """At the goal's orientation four fingers, 8 mm away from a square's sides, leave it a square of 16 mm."""
    assert start_area(TASK, ANSWER) == pytest.approx(0.016**2, rel=1e-6)


def test_the_comparison_starts_both_strategies_at_the_same_poses() -> None:
    starts, errors, ends = force_closure_comparison(TASK, ANSWER, 20)
    assert starts.shape == (20, 3)
    assert set(errors) == set(ends) == {"force closure", "certified"}
    for name, (poses, _) in ends.items():
        np.testing.assert_allclose(errors[name], pose_errors(TASK, poses))
    assert errors["certified"].max() < 1e-9


def test_a_figure_that_cannot_be_written_is_refused_before_it_is_computed(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert main(["5-31", "-o", str(tmp_path / "absent" / "a.png")]) == 2
    assert main(["5-31", "-o", str(tmp_path / "a.bmp")]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 2
