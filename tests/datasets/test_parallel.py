import os
import time
from functools import partial
from pathlib import Path

import pytest

from datasets.parallel import followed, progress_bar, side_by_side
from expert.errors import InvalidProblem, SolverFailed


def call(folder: Path, k: int) -> tuple[int, int]:
    """Leave a file; the number, and the process that did it."""
    if k < 0:
        raise InvalidProblem("data", expected="a number >= 0", got=f"{k}")
    time.sleep(0.05)
    (folder / f"{k}").touch()
    return k, os.getpid()


@pytest.mark.parametrize("jobs", [1, 2])
def test_calls_run_in_as_many_processes_as_asked_for(tmp_path: Path, jobs: int) -> None:
    answers = dict(side_by_side([partial(call, tmp_path, k) for k in range(3)], jobs=jobs))
    assert sorted(answers) == [0, 1, 2]
    assert {p.name for p in tmp_path.iterdir()} == {"0", "1", "2"}
    assert (os.getpid() in answers.values()) == (jobs == 1)


def test_what_a_worker_refuses_is_said_by_the_master(tmp_path: Path) -> None:
    with pytest.raises(InvalidProblem, match="data: expected a number >= 0, got -1"):
        list(side_by_side([partial(call, tmp_path, -1)], jobs=2))


def test_a_dead_worker_is_no_answer() -> None:
    with pytest.raises(SolverFailed, match=r"a worker died .*; make it goes on from there"):
        list(side_by_side([partial(os._exit, 1)], jobs=2, again="make it"))


def test_who_stops_early_hears_nothing_of_it(tmp_path: Path, recwarn: pytest.WarningsRecorder) -> None:
    answers = side_by_side([partial(call, tmp_path, k) for k in range(20)], jobs=2)
    next(answers)
    answers.close()  # type: ignore[attr-defined]
    assert not recwarn.list


def test_a_missing_backend_is_named() -> None:
    pytest.importorskip("joblib")
    try:
        import ray  # noqa: F401
    except ImportError:
        with pytest.raises(InvalidProblem, match=r"backend: expected an installed backend, got ray"):
            list(side_by_side([partial(int, 3)], jobs=1, backend="ray"))


def test_a_followed_bar_asks_how_far_the_work_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("datasets.parallel.POLL", 0.01)
    seen: list[int] = []
    with progress_bar("work", 7) as show, followed(lambda done, title=None: seen.append(done), lambda: 5):
        show(1, "other work")
        time.sleep(0.2)
    assert set(seen) == {5}
