"""Training stages side by side in worker processes, with one progress bar for all of them."""

import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import chain

import joblib
from joblib.externals.loky.process_executor import BrokenProcessPool
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from dlm.training.stage import Stage
from expert.errors import SolverFailed

POLL = 1.0
"""Between two looks at how far the workers are [s]."""


def chains(stages: Sequence[Stage]) -> list[list[Stage]]:
    """Stages that start from one another's weights, in order; different chains do not wait for each other.  Longest first."""
    found: list[list[Stage]] = []
    for stage in stages:
        before = [row for row in found if stage.warm_start in [earlier.name for earlier in row]]
        if before:
            before[0].append(stage)
        else:
            found.append([stage])
    return sorted(found, key=len, reverse=True)


def run_side_by_side(
    calls: Sequence[Callable[[], Sequence[str]]], *, jobs: int, progress: Callable[[], int], total: int
) -> Iterator[str]:
    """Make all calls in `jobs` processes; what they return, line by line, as they end.

    progress: how much of `total` is done, looked at while the workers work.  Raises SolverFailed where a worker dies.
    """
    pool = joblib.Parallel(n_jobs=jobs, backend="loky", return_as="generator_unordered", batch_size=1)
    with _bar(progress, total):
        try:
            yield from chain.from_iterable(pool(joblib.delayed(_quietly)(call) for call in calls))
        except BrokenProcessPool as error:
            raise SolverFailed(
                f"a worker died ({error}); the same command with resume=true goes on"
            ) from error


def _quietly(call: Callable[[], Sequence[str]]) -> Sequence[str]:
    """In a worker, which leaves interrupts to the master process."""
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    return call()


@contextmanager
def _bar(progress: Callable[[], int], total: int) -> Iterator[None]:
    """A progress bar that follows `progress()`; nothing where stderr is no terminal."""
    console = Console(stderr=True)
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
    over = threading.Event()
    with Progress(*columns, console=console, disable=not console.is_terminal) as shown:
        bar = shown.add_task("iterations", total=total)

        def follow() -> None:
            while not over.wait(POLL):
                shown.update(bar, completed=progress())

        follower = threading.Thread(target=follow, daemon=True)
        follower.start()
        try:
            yield
            shown.update(bar, completed=total)
        finally:
            over.set()
            follower.join()
