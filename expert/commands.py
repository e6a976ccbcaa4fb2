"""The commands of `python -m expert`: solve, verify and draw; each returns its exit code.

Which solver, checker or picture belongs to a kind of problem: `expert.kinds`.
"""

import argparse
import contextlib
import json
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from typing import Any

from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from expert.files import Problem, problem_of, read_problem, solution_of, write_solution
from expert.files.document import load, save, writable
from expert.files.section import jsonable
from expert.kinds import KINDS

SOLVED, REFUTED, BAD_INPUT, INFEASIBLE, UNKNOWN, INTERRUPTED = 0, 1, 2, 3, 4, 130
VERDICTS = {"sound": SOLVED, "caged": SOLVED, "certified": SOLVED, "refuted": REFUTED, "escapes": REFUTED}


def solve(options: argparse.Namespace) -> int:
    """Read a problem file, solve it, write a solution file."""
    if options.output:
        writable(options.output)
    problem = read_problem(options.file)
    if options.method:
        # Through the reader once more, so that a wrong method is refused like a wrong file.
        chosen = {**(problem.data.get("options") or {}), "method": options.method}
        problem = problem_of({**problem.data, "options": chosen})
    kind = KINDS[problem.kind]
    with _progress(f"solving {options.file.name}"):
        answer = _interruptible(lambda: kind.solve(problem.task, **problem.options))
    if options.output:
        write_solution(options.output, problem, answer)
    _report_solution(options, answer)
    if answer.status == "infeasible":
        return INFEASIBLE
    return SOLVED if answer.status in kind.solved else UNKNOWN


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
    if options.output:
        writable(options.output)
    problem, answer = _read_either(load(options.file))
    with _progress(f"checking {options.file.name}"):
        report = _interruptible(lambda: KINDS[problem.kind].verify(problem.task, answer))
    if options.output:
        save(options.output, report.as_dict())
    print(report)
    return VERDICTS.get(report.verdict, UNKNOWN)


def draw(options: argparse.Namespace) -> int:
    """Draw a solution file, or a problem file that states what there is to draw."""
    writable(options.output)
    problem, answer = _read_either(load(options.file))
    with _progress(f"drawing {options.output.name}"):
        KINDS[problem.kind].draw(problem.task, answer, options.output, options.view)
    print(f"picture in {options.output}")
    return SOLVED


def _read_either(data: dict[str, Any]) -> tuple[Problem, Any]:
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
