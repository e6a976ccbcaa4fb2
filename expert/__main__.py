"""Command line: python -m expert solve problem.yaml -o solution.json | verify solution.json | draw solution.json -o picture.png

Exit codes: 0 solved, sound or drawn; 1 refuted (or a solver that failed); 2 bad input; 3 proved infeasible;
4 limit hit or unknown; 130 interrupted.
"""

import argparse
import contextlib
import json
import os
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from expert.errors import ExpertError, InvalidProblem
from expert.files import problem_of, read_problem, solution_of, write_solution
from expert.files.document import load, save, writable

SOLVED, REFUTED, BAD_INPUT, INFEASIBLE, UNKNOWN, INTERRUPTED = 0, 1, 2, 3, 4, 130
VERDICTS = {"sound": SOLVED, "caged": SOLVED, "certified": SOLVED, "refuted": REFUTED, "escapes": REFUTED}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code; whatever is wrong with the input becomes one line on stderr."""
    options = _parser().parse_args(arguments)
    try:
        code: int = options.command(options)
    except InvalidProblem as error:
        print(f"error: {options.file}: {error}", file=sys.stderr)
        return BAD_INPUT
    except ExpertError as error:
        print(f"error: {error}", file=sys.stderr)
        return REFUTED
    except KeyboardInterrupt:
        print(
            "interrupted: nothing was written; run the same command to start again",
            file=sys.stderr,
            flush=True,
        )
        # A computation may still run in its thread, in compiled code that cannot be stopped otherwise.
        os._exit(INTERRUPTED)
    return code


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m expert", description="Plan, check and draw planar manipulation."
    )
    commands = parser.add_subparsers(required=True, metavar="solve | verify | draw")

    solve = commands.add_parser("solve", help="read a problem file, write a solution file")
    solve.add_argument("file", type=Path, help="problem file, YAML or JSON (docs/files.md)")
    solve.add_argument("-o", "--output", type=Path, help="solution file, JSON; without it nothing is written")
    solve.add_argument("--method", help="solver to use instead of the file's options.method")
    solve.add_argument("--summary", action="store_true", help="print one JSON line")
    solve.set_defaults(command=_solve)

    verify = commands.add_parser("verify", help="check a solution file without solving anything")
    verify.add_argument("file", type=Path, help="solution file, or a problem file that states what to check")
    verify.add_argument("-o", "--output", type=Path, help="certificate file, JSON")
    verify.set_defaults(command=_verify)

    draw = commands.add_parser("draw", help="picture or animation of a solution file")
    draw.add_argument("file", type=Path, help="solution file")
    draw.add_argument("-o", "--output", type=Path, required=True, help=".png, .svg, .pdf, .gif or .mp4")
    draw.add_argument("--view", help="one part of the picture of a cage: workspace, slice or component")
    draw.set_defaults(command=_draw)
    return parser


def _solve(options: argparse.Namespace) -> int:
    if options.output:
        writable(options.output)
    problem = read_problem(options.file)
    if options.method:
        # Through the reader once more, so that a wrong method is refused like a wrong file.
        chosen = {**(problem.data.get("options") or {}), "method": options.method}
        problem = problem_of({**problem.data, "options": chosen})
    solve = problem.entry.function("solve")
    with _progress(f"solving {options.file.name}"):
        answer = _interruptible(lambda: solve(problem.task, **problem.options))
    if options.output:
        write_solution(options.output, problem, answer)
    _report_solution(options, answer)
    if answer.status == "infeasible":
        return INFEASIBLE
    return SOLVED if answer.status in problem.entry.solved else UNKNOWN


def _report_solution(options: argparse.Namespace, answer: Any) -> None:
    keys = ("status", "objective", "bound", "gap", "seconds")
    summary = {key: _plain(getattr(answer, key)) for key in keys if hasattr(answer, key)}
    if options.summary:
        print(json.dumps(summary))
        return
    print(", ".join(f"{key} {_brief(value)}" for key, value in summary.items() if value is not None))
    if reason := getattr(answer, "reason", ""):
        print(reason)
    if options.output:
        print(f"solution in {options.output}; next: python -m expert verify {options.output}")


def _plain(value: Any) -> Any:
    """JSON knows neither infinity nor nan."""
    return value if isinstance(value, str) else float(value) if np.isfinite(value) else None


def _brief(value: Any) -> str:
    return value if isinstance(value, str) else f"{value:.6g}"


def _verify(options: argparse.Namespace) -> int:
    if options.output:
        writable(options.output)
    data = load(options.file)
    if "solution" in data:
        solution = solution_of(data)
        problem, answer = solution.problem, solution.answer
    else:
        problem, answer = problem_of(data), None
    verify = problem.entry.function("verify")
    with _progress(f"checking {options.file.name}"):
        report = _interruptible(lambda: verify(problem.task, answer))
    if options.output:
        save(options.output, report.as_dict())
    print(report)
    return VERDICTS.get(report.verdict, UNKNOWN)


def _draw(options: argparse.Namespace) -> int:
    writable(options.output)
    data = load(options.file)
    if "solution" not in data and not problem_of(data).entry.views:
        raise InvalidProblem(
            "solution", expected="a solution file", got="a problem file", remedy="solve it first"
        )
    solution = solution_of(data) if "solution" in data else None
    problem = solution.problem if solution else problem_of(data)
    view = {"view": _view(options.view, problem.entry.views)} if options.view else {}
    draw = problem.entry.function("draw")
    with _progress(f"drawing {options.output.name}"):
        draw(problem.task, solution.answer if solution else None, options.output, **view)
    print(f"picture in {options.output}")
    return SOLVED


def _view(name: str, known: tuple[str, ...]) -> str:
    if name not in known:
        raise InvalidProblem("view", expected=" or ".join(known) or "none for this kind", got=name)
    return name


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


if __name__ == "__main__":
    sys.exit(main())
