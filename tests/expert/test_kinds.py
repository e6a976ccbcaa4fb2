"""What a kind loads: a checker never a solver, a solver never a picture; and every kind has what the commands call."""

import subprocess
import sys
from pathlib import Path

import pytest

from expert.errors import InvalidProblem
from expert.files import FORMATS
from expert.kinds import KINDS, Kind

SOLVERS = (
    "expert.contact",
    "expert.caging",
    "expert.grasping",
    "expert.pushing",
    "expert.mip",
    "expert.loops",
    "cvxpy",
    "pyscipopt",
)
LOADED = """
import sys
from expert.errors import InvalidProblem
from expert.files import read_problem
from expert.kinds import KINDS
problem = read_problem({path!r})
{call}
print(*(name for name in {names!r} if name in sys.modules))
"""
STATED = "configs/problem/cage/i_given.yaml"
REFUSED = "try:\n    KINDS[problem.kind].verify(problem.task, None)\nexcept InvalidProblem:\n    pass"


def loaded(path: str, call: str, names: tuple[str, ...]) -> list[str]:
    """Which of the modules a fresh interpreter has loaded after the call."""
    program = LOADED.format(path=path, call=call, names=names)
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    return done.stdout.split()


@pytest.mark.parametrize(
    ("path", "call"),
    [
        (STATED, "assert KINDS['cage'].verify(problem.task, None).verdict == 'caged'"),
        ("configs/problem/certified_grasp/t.yaml", REFUSED),
        ("configs/problem/push/tee.yaml", REFUSED),
        ("configs/problem/contact_trajectory/block_slide_one_finger.yaml", "import expert.verify.plan.check"),
    ],
)
def test_reading_and_checking_load_no_solver_and_no_picture(path: str, call: str) -> None:
    assert loaded(path, call, (*SOLVERS, "matplotlib")) == []


def test_solving_loads_its_solver_and_no_picture() -> None:
    slide = "configs/problem/contact_trajectory/block_slide_one_finger.yaml"
    call = "assert KINDS[problem.kind].solve(problem.task, **problem.options).status == 'optimal'"
    assert loaded(slide, call, (*SOLVERS, "matplotlib")) == ["expert.contact"]


@pytest.mark.parametrize("name", KINDS)
def test_every_kind_has_a_format_and_does_all_that_the_commands_ask(name: str) -> None:
    kind = KINDS[name]
    assert name in FORMATS
    assert kind.solved
    for role in ("solve", "verify", "draw"):
        assert getattr(type(kind), role) is not getattr(Kind, role)


@pytest.mark.parametrize("name", ["contact_trajectory", "certified_grasp", "push"])
def test_a_view_of_a_kind_without_views_is_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(InvalidProblem, match="view: expected none for this kind, got slice"):
        KINDS[name].draw(None, None, tmp_path / "a.png", "slice")
