"""Pictures of certified grasps exist, show what they say, and are refused where there is nothing to show."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from expert.drawing.certified_grasp import draw, grasp_figure
from expert.errors import InvalidProblem
from expert.grasping.executions import executions
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
