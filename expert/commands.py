"""The commands of `python -m expert`: solve, verify and draw; each returns its exit code.

Which solver, checker or picture belongs to a kind of problem: `expert.kinds`.
"""

import argparse
import contextlib
import json
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from expert.errors import InvalidProblem
from expert.files import Problem, problem_of, read_problem, solution_fields, solution_of
from expert.files.document import encoded, load
from expert.files.output import Output
from expert.files.section import jsonable
from expert.kinds import KINDS

SOLVED, REFUTED, BAD_INPUT, INFEASIBLE, UNKNOWN, INTERRUPTED = 0, 1, 2, 3, 4, 130
VERDICTS = {"sound": SOLVED, "caged": SOLVED, "certified": SOLVED, "refuted": REFUTED, "escapes": REFUTED}


def solve(options: argparse.Namespace) -> int:
    """Read a problem file, solve it, write a solution file."""
    with _reserved(options) as output:
        problem = _read_with_method(options.file, options.method)
        kind = KINDS[problem.kind]
        with _progress(f"solving {options.file.name}"):
            answer = _interruptible(lambda: kind.solve(problem.task, **problem.options))
        if output:
            output.deliver(encoded(solution_fields(problem, answer)))
    _report_solution(options, answer)
    if answer.status == "infeasible":
        return INFEASIBLE
    return SOLVED if answer.status in kind.solved else UNKNOWN


def _read_with_method(path: Path, method: str | None) -> Problem:
    problem = read_problem(path)
    if not method:
        return problem
    # Through the reader once more, so that a wrong method is refused like a wrong file.
    chosen = {**(problem.data.get("options") or {}), "method": method}
    return problem_of({**problem.data, "options": chosen})


@contextlib.contextmanager
def _reserved(options: argparse.Namespace) -> Iterator[Output | None]:
    """The output that is asked for, if any; never the input itself."""
    if options.output is None:
        yield None
        return
    with contextlib.suppress(OSError):  # one of them does not exist
        if options.output.samefile(options.file):
            raise InvalidProblem("output", expected="another file than the input", got=str(options.output))
    with Output(options.output) as output:
        yield output


def _report_solution(options: argparse.Namespace, answer: Any) -> None:
    keys = ("status", "objective", "bound", "gap", "seconds")
    summary = {key: jsonable(getattr(answer, key)) for key in keys if hasattr(answer, key)}
    if options.summary:
        print(json.dumps(summary))
        return
    print(", ".join(f"{key} {_brief(value)}" for key, value in summary.items() if value is not None))
    if reason := getattr(answer, "reason", ""):
        print(reason)
    if options.output:
        print(f"solution in {options.output}; next: python -m expert verify {options.output}")


def _brief(value: Any) -> str:
    return value if isinstance(value, str) else f"{value:.6g}"


def verify(options: argparse.Namespace) -> int:
    """Check a solution file, or a problem file that states what there is to check; write a certificate."""
    with _reserved(options) as output:
        problem, answer = read_either(load(options.file))
        with _progress(f"checking {options.file.name}"):
            report = _interruptible(lambda: KINDS[problem.kind].verify(problem.task, answer))
        print(report)
        if output:
            output.deliver(encoded(report.as_dict()))
    return VERDICTS.get(report.verdict, UNKNOWN)


def draw(options: argparse.Namespace) -> int:
    """Draw a solution file, or a problem file that states what there is to draw."""
    with _reserved(options):
        pass  # the drawing writes its file itself
    problem, answer = read_either(load(options.file))
    with _progress(f"drawing {options.output.name}"):
        KINDS[problem.kind].draw(problem.task, answer, options.output, options.view)
    print(f"picture in {options.output}")
    return SOLVED


def read_either(data: dict[str, Any]) -> tuple[Problem, Any]:
    """Problem and answer of a solution file; no answer for a problem file."""
    if "solution" not in data:
        return problem_of(data), None
    solution = solution_of(data)
    return solution.problem, solution.answer


def _interruptible(work: Callable[[], Any]) -> Any:
    """The result of work done in a thread of its own, so that Ctrl-C arrives here.

    In the thread that it interrupts, compiled code may return with an exception half set and crash the interpreter.
    """
    outcome: Future[Any] = Future()

    def run() -> None:
        try:
            outcome.set_result(work())
        except BaseException as error:
            outcome.set_exception(error)

    threading.Thread(target=run, daemon=True).start()
    return outcome.result()


@contextlib.contextmanager
def _progress(what: str) -> Iterator[None]:
    """A spinner with the elapsed time on stderr; nothing where that is no terminal."""
    console = Console(stderr=True)
    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress:
        progress.add_task(what, total=None)
        yield
