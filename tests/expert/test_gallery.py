"""Every problem of the gallery is solved, or proved infeasible, as its name says, and the checker agrees."""

import itertools
from pathlib import Path

import numpy as np
import pytest

from expert.contact import solve
from expert.drawing.contact_trajectory import COLUMNS, FRAMES_PER_STEP
from expert.drawing.marks import FINGER, FINGER_FORCE, OBJECT, WALL
from expert.files import read_problem
from expert.verify.plan.check import verify
from expert.verify.plan.claims import EFFORT
from tests.support.pictures import coloured, frames_of

PROBLEMS = sorted(Path("configs/problem/contact_trajectory").glob("*.yaml"))
SEQUENCES = "tool_pivot_one_finger"
"""Infeasible because contacts must persist: each step by itself can be balanced."""


@pytest.mark.parametrize("path", PROBLEMS, ids=lambda p: p.stem)
def test_verdicts_of_solver_and_checker(path: Path) -> None:
    problem = read_problem(path)
    answer = solve(problem.task, **problem.options)
    impossible = path.stem.endswith("_infeasible") or path.stem == SEQUENCES
    assert answer.status == ("infeasible" if impossible else "optimal")
    report = verify(problem.task, answer)
    assert report.verdict == "sound", str(report)
    assert report.claimed == EFFORT


SHOWN = [
    path for path in PROBLEMS if not path.stem.endswith("_infeasible") and path.stem != SEQUENCES
]  # fmt: skip


def test_the_gallery_names_every_problem() -> None:
    page = Path("docs/gallery.md").read_text()
    assert all(path.stem in page for path in PROBLEMS)


@pytest.mark.parametrize("path", SHOWN, ids=lambda p: p.stem)
def test_the_gallery_shows_every_plan_at_each_step_and_in_motion(path: Path) -> None:
    task = read_problem(path).task
    (strip,) = frames_of(Path("docs/gallery") / f"{path.stem}.png")
    columns = min(task.steps, COLUMNS)
    for row in np.array_split(strip[20:-60], -(-task.steps // COLUMNS)):
        for panel in np.array_split(row, columns, axis=1)[: 1 if task.steps > COLUMNS else columns]:
            assert coloured(panel, OBJECT).mean() > 0.01
    assert coloured(strip, FINGER).sum() > 15 * task.steps
    assert coloured(strip, FINGER_FORCE).sum() > 50
    assert (coloured(strip[:-60], WALL, 4).sum() > 500) == bool(task.environment.walls)
    film = frames_of(Path("docs/gallery") / f"{path.stem}.gif")
    assert len(film) > (task.steps - 1) * FRAMES_PER_STEP / 2  # equal frames are merged into one
    shares = [coloured(frame, OBJECT).mean() for frame in film]
    assert min(shares) > 0.01
    assert all((a != b).any() for a, b in itertools.pairwise(film))
