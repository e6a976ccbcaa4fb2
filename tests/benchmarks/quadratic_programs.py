"""Small dense quadratic programs: our compiled method against the libraries behind it, and how often these are needed.

    python -m tests.benchmarks.quadratic_programs [--quick] [--tasks 200] [--json FILE]

Bars: ours is right, and the fastest up to 24 variables; of the contact tasks' programs that go on to the libraries none is left unsettled.
"""

import argparse
import json
import sys
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from expert.contact import solve
from expert.geometry.pose import Array
from expert.numeric import qp
from expert.numeric.qp import SOLVED, compiled, goldfarb_idnani
from tests.support.random_tasks import floor_task

SIZES = (6, 12, 24, 42)
"""Variables."""
SMALL = 24
"""Up to so many, speed is asked for: a step of the planner, or a sequence of a few."""
EQUALITIES, ITERATIONS = 3, 1000
LIBRARIES = {"DAQP": "_daqp", "PIQP": "_piqp", "Clarabel": "_clarabel"}
NAMES = ("ours", *LIBRARIES)


@compiled
def repeated(H: Array, g: Array, A: Array, b: Array, count: int) -> float:
    """Solve the same program `count` times from compiled code, as the planner does."""
    total = 0.0
    for _ in range(count):
        total += goldfarb_idnani(H, g, A, b, EQUALITIES, ITERATIONS)[1][0]
    return total


def program(rng: np.random.Generator, n: int) -> tuple[Array, Array, Array, Array]:
    """Convex and feasible, three times as many constraints as variables, a third of them active or nearly so."""
    half = rng.normal(size=(n, n))
    A = rng.normal(size=(3 * n, n))
    slack = rng.random(3 * n) * (rng.random(3 * n) < 0.7)
    slack[:EQUALITIES] = 0
    return half @ half.T + 0.1 * np.eye(n), rng.normal(size=n), A, A @ rng.normal(size=n) - slack


def timings(count: int, repeats: int) -> list[dict[str, Any]]:
    """Median processor time [us] of a program by size and method."""
    rng, rows = np.random.default_rng(0), []
    repeated(*program(rng, 4), 1)
    for n in SIZES:
        spent: dict[str, list[float]] = {name: [] for name in NAMES}
        misses: Counter[str] = Counter()
        for _ in range(count):
            H, g, A, b = program(rng, n)
            misses["ours"] += not right(H, g, A, b, goldfarb_idnani(H, g, A, b, EQUALITIES, ITERATIONS))
            spent["ours"].append(seconds(lambda: repeated(H, g, A, b, repeats)) / repeats)  # noqa: B023
            for name, function in LIBRARIES.items():
                method = getattr(qp, function)
                misses[name] += not right(H, g, A, b, method(H, g, A, b, EQUALITIES))
                spent[name].append(seconds(lambda: method(H, g, A, b, EQUALITIES)))  # noqa: B023
        medians = {name: 1e6 * float(np.median(values)) for name, values in spent.items()}
        rows.append({"variables": n, **medians, "misses": dict(misses)})
    return rows


def right(H: Array, g: Array, A: Array, b: Array, answer: tuple[int, Array, Array]) -> bool:
    """Whether the answer is an optimum: feasible, multipliers of the right sign, and nothing left of the gradient."""
    status, x, u = answer
    slack = A @ x - b
    unmet = [
        np.abs(H @ x + g - A.T @ u),
        np.abs(slack[:EQUALITIES]),
        -slack,
        -u[EQUALITIES:],
        np.abs(u * slack),
    ]
    return status == SOLVED and max(float(values.max()) for values in unmet) < 1e-6


def seconds(work: Callable[[], object]) -> float:
    """Processor time of the work."""
    began = time.process_time()
    work()
    return time.process_time() - began


def passed_on(tasks: int) -> Counter[str]:
    """What became of programs that our method did not settle, over random contact tasks."""
    outcomes: Counter[str] = Counter()
    originals = {name: getattr(qp, function) for name, function in LIBRARIES.items()}

    def counted(name: str) -> Callable[..., tuple[int, Array, Array]]:
        def method(*arguments: Any) -> tuple[int, Array, Array]:
            answer = originals[name](*arguments)
            outcomes[f"{name}: {('solved', 'infeasible', 'failed')[answer[0]]}"] += 1
            return answer

        return method

    try:
        for name, function in LIBRARIES.items():
            setattr(qp, function, counted(name))
        for seed in range(tasks):
            rng = np.random.default_rng(seed)
            solve(floor_task(rng, facets=int(rng.integers(4, 7)), steps=5), node_limit=2000)
    finally:
        for name, function in LIBRARIES.items():
            setattr(qp, function, originals[name])
    return outcomes


def main() -> int:
    """Print both tables; 1 where a bar is missed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="few programs, 40 tasks")
    parser.add_argument("--tasks", type=int, default=200)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    rows = timings(*((20, 20) if options.quick else (200, 100)))
    tasks = min(options.tasks, 40) if options.quick else options.tasks
    outcomes = passed_on(tasks)
    table = Table(
        "variables",
        *NAMES,
        title="processor time of a program, median in microseconds; answers that are no optimum to 1e-6",
    )
    for row in rows:
        cells = (
            f"{row[name]:.0f}" + (f" ({k} off)" if (k := row["misses"].get(name)) else "") for name in NAMES
        )
        table.add_row(str(row["variables"]), *cells)
    console = Console()
    console.print(table)
    console.print(f"{tasks} contact tasks; programs passed on: {dict(outcomes) or 'none'}")
    if options.json:
        options.json.write_text(
            json.dumps({"timings": rows, "tasks": tasks, "passed_on": outcomes}, indent=1)
        )
    slower = [
        row["variables"]
        for row in rows
        if row["variables"] <= SMALL and row["ours"] > min(row[name] for name in LIBRARIES)
    ]
    missed = [f"a library is faster at {slower} variables"] if slower else []
    missed += ["our method missed an optimum"] if any(row["misses"].get("ours") for row in rows) else []
    missed += ["a program was left unsettled"] if outcomes["Clarabel: failed"] else []
    console.print("bars met" if not missed else f"bars missed: {'; '.join(missed)}")
    return int(bool(missed))


if __name__ == "__main__":
    sys.exit(main())
