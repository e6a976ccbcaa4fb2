"""Calls side by side in processes, and progress bars.  An interrupt is the business of the master process alone."""

import os
import signal
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any, Literal, Protocol, TypeVar

import joblib
from joblib.externals.loky.process_executor import BrokenProcessPool
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from expert.errors import InvalidProblem, SolverFailed

T = TypeVar("T")
Backend = Literal["loky", "ray"]

POLL = 1.0
"""Between two looks at how far workers are [s]."""
WAVE = 4
"""Calls per process that Ray's backend is given at a time: it returns only whole batches."""


def side_by_side(
    calls: Sequence[Callable[[], T]], *, jobs: int, backend: Backend = "loky", again: str = "the same command"
) -> Iterator[T]:
    """What the calls return, in whatever order they end; with one job, in this process.

    backend: loky (this machine) or ray (a cluster).  again: the command that goes on from there, for the SolverFailed that
    a worker's death raises.
    """
    if backend == "ray":
        _register_ray()
    work = [joblib.delayed(_quietly)(call, os.getpid()) for call in calls]
    with joblib.parallel_config(backend=backend, n_jobs=jobs):
        try:
            if backend == "loky":
                yield from _unordered(work)
                return
            wave = WAVE * joblib.effective_n_jobs(jobs)
            for start in range(0, len(work), wave):
                yield from joblib.Parallel(batch_size=1)(work[start : start + wave])
        except BrokenProcessPool as error:
            why = str(error).splitlines()[0]
            raise SolverFailed(f"a worker died ({why}); {again} goes on from there") from error


def _unordered(work: Sequence[Any]) -> Iterator[Any]:
    results = joblib.Parallel(return_as="generator_unordered", batch_size=1)(work)
    try:
        for result in results:  # noqa: UP028 - `yield from` would close it first, and not quietly
            yield result
    finally:
        with warnings.catch_warnings():  # who stops early knows that calls are left
            warnings.filterwarnings("ignore", message=r"\d+ tasks (have been|which were)")
            results.close()


def _quietly(call: Callable[[], T], master: int) -> T:
    """In a worker, which leaves interrupts to the master process."""
    if os.getpid() != master and threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    return call()


def _register_ray() -> None:
    try:
        from ray.util.joblib import register_ray
    except ImportError as error:
        raise InvalidProblem(
            "backend",
            expected="an installed backend",
            got="ray, which is not",
            remedy="pip install certified-manipulation[ray]",
        ) from error
    register_ray()


class Show(Protocol):
    """Tell a progress bar how much is done, and by another title what of."""

    def __call__(self, done: int, title: str | None = None) -> None: ...


@contextmanager
def progress_bar(title: str, total: int, done: int = 0) -> Iterator[Show]:
    """A bar on stderr; nothing where that is no terminal."""
    console = Console(stderr=True)
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
    with Progress(*columns, console=console, disable=not console.is_terminal) as progress:
        bar = progress.add_task(title, total=total, completed=done)

        def show(done: int, title: str | None = None) -> None:
            progress.update(bar, completed=done, description=title)

        yield show


@contextmanager
def followed(show: Show, progress: Callable[[], int]) -> Iterator[None]:
    """A bar that looks for itself, by `progress()`, how far the workers of the block are."""
    over = threading.Event()
    thread = threading.Thread(target=partial(_follow, show, progress, over), daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def _follow(show: Show, progress: Callable[[], int], over: threading.Event) -> None:
    while not over.wait(POLL):
        show(progress())
