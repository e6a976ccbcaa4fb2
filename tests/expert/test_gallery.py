"""Every problem of the gallery is solved, or proved infeasible, as its name says, and the checker agrees."""

from pathlib import Path

import pytest

from expert.contact import solve
from expert.files import read_problem
from expert.verify.plan.check import verify

PROBLEMS = sorted(Path("configs/problem/contact_trajectory").glob("*.yaml"))
UNPROVED = "tool_pivot_one_finger"
"""Infeasible because contacts must persist, which the checker's step-by-step proof cannot show."""


@pytest.mark.parametrize("path", PROBLEMS, ids=lambda p: p.stem)
def test_verdicts_of_solver_and_checker(path: Path) -> None:
    problem = read_problem(path)
    answer = solve(problem.task, **problem.options)
    impossible = path.stem.endswith("_infeasible") or path.stem == UNPROVED
    assert answer.status == ("infeasible" if impossible else "optimal")
    report = verify(problem.task, answer)
    assert report.verdict == ("unknown" if path.stem == UNPROVED else "sound"), str(report)


def test_the_gallery_shows_every_plan_twice() -> None:
    page = Path("docs/gallery.md").read_text()
    for path in PROBLEMS:
        assert path.stem in page
        if not path.stem.endswith("_infeasible") and path.stem != UNPROVED:
            assert all(
                (Path("docs/gallery") / f"{path.stem}{ending}").stat().st_size for ending in (".png", ".gif")
            )
