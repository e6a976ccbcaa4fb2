"""One entry for three methods, which agree on what a small task costs."""

import subprocess
import sys

import numpy as np
import pytest

from expert.contact import solve
from expert.errors import InvalidProblem
from tests.support.random_tasks import floor_task


def test_three_methods_answer_one_task() -> None:
    task = floor_task(np.random.default_rng(2), fingers=1, steps=3, facets=3)
    exact, thesis, scip = (solve(task, method=m) for m in ("exact", "thesis", "scip"))  # type: ignore[arg-type]
    assert exact.status == thesis.status == scip.status == "optimal"
    assert scip.objective == pytest.approx(exact.objective, rel=2e-3)
    assert thesis.bound <= exact.objective * (1 + 1e-6)


def test_unknown_methods_and_too_many_fingers_are_refused() -> None:
    with pytest.raises(InvalidProblem, match="method: expected one of exact, thesis, scip"):
        solve(floor_task(np.random.default_rng(1)), method="magic")  # type: ignore[arg-type]
    with pytest.raises(InvalidProblem, match=r"fingers\.count"):
        solve(floor_task(np.random.default_rng(1), facets=6, fingers=6))


def test_the_exact_method_loads_no_modelling_language() -> None:
    loaded = (
        "import sys, expert.contact.exact; print([m for m in ('cvxpy', 'pyscipopt') if m in sys.modules])"
    )
    answer = subprocess.run([sys.executable, "-c", loaded], capture_output=True, text=True, check=True)
    assert answer.stdout.strip() == "[]"
