"""What each numerical library is for, by measurement: quadratic programs ours and theirs, what is passed on, cages by two solvers.

    python -m tests.benchmarks.solvers [--quick] [--tasks 200] [--json FILE]

Processor time.  Bars: on programs of the search's size (up to 12 variables) ours is at least 3 times faster than any library; the
search takes at least 3 times longer where every program goes to a library; nothing that ours does not settle is left
unsettled; HiGHS finds the cage faster than SCIP.  DAQP and PIQP are compared where they are installed.
"""

import argparse
import importlib
import importlib.util
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

from expert.budget import Budget
from expert.caging.synthesis import solve as find_cage
from expert.contact import scaled, solve
from expert.contact.exact import warm_up
from expert.files import read_problem
from expert.geometry.pose import Array
from expert.numeric import qp
from expert.numeric.qp import SOLVED, compiled, goldfarb_idnani
from tests.support.random_tasks import floor_task

SIZES = (6, 12, 24, 42)
"""Variables; a step of the search has up to 12, the largest master program of a ten-step task 42."""
EQUALITIES, ITERATIONS = 3, 1000
CAGE = Path(__file__).parents[2] / "configs" / "problem" / "cage" / "t_3.yaml"
Program = tuple[Array, Array, Array, Array]


@compiled
def repeated(H: Array, g: Array, A: Array, b: Array, count: int) -> float:
    """Solve the same program `count` times from compiled code, as the search does."""
    total = 0.0
    for _ in range(count):
        total += goldfarb_idnani(H, g, A, b, EQUALITIES, ITERATIONS)[1][0]
    return total


def by_daqp(H: Array, g: Array, A: Array, b: Array) -> Array:
    """Minimiser by DAQP."""
    daqp = importlib.import_module("daqp")
    upper = np.where(np.arange(len(b)) < EQUALITIES, b, 1e30)
    sense = np.where(np.arange(len(b)) < EQUALITIES, 5, 0).astype(np.int32)
    return np.asarray(daqp.solve(H, g, A, upper, b.copy(), sense, primal_tol=qp.FEASIBILITY)[0])


def by_piqp(H: Array, g: Array, A: Array, b: Array) -> Array:
    """Minimiser by PIQP."""
    solver, e = importlib.import_module("piqp").DenseSolver(), EQUALITIES
    solver.settings.eps_abs = solver.settings.eps_rel = qp.FEASIBILITY
    solver.setup(H, g, A[:e], b[:e], A[e:], b[e:], np.full(len(b) - e, np.inf))
    solver.solve()
    return np.array(solver.result.x)


def by_clarabel(H: Array, g: Array, A: Array, b: Array) -> Array:
    """Minimiser by Clarabel, as `expert.numeric` calls it."""
    return qp.fallback(H, g, A, b, EQUALITIES)[1]


LIBRARIES = {"DAQP": by_daqp, "PIQP": by_piqp, "Clarabel": by_clarabel}


def installed() -> dict[str, Callable[..., Array]]:
    """Libraries that are there."""
    return {name: f for name, f in LIBRARIES.items() if importlib.util.find_spec(name.lower()) is not None}


def program(rng: np.random.Generator, n: int) -> Program:
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
        spent: dict[str, list[float]] = {name: [] for name in ("ours", *installed())}
        for _ in range(count):
            data = program(rng, n)
            status, expected, _ = goldfarb_idnani(*data, EQUALITIES, ITERATIONS)
            assert status == SOLVED
            spent["ours"].append(seconds(lambda: repeated(*data, repeats)) / repeats)  # noqa: B023
            for name, method in installed().items():
                assert np.abs(method(*data) - expected).max() < 1e-5
                spent[name].append(seconds(lambda: method(*data)))  # noqa: B023
        rows.append(
            {"variables": n, **{name: 1e6 * float(np.median(values)) for name, values in spent.items()}}
        )
    return rows


def seconds(work: Callable[[], object]) -> float:
    """Processor time of the work."""
    budget = Budget(np.inf)
    work()
    return budget.spent


def searches(tasks: int) -> dict[str, Any]:
    """Seconds of searches with our method, what they passed on, and of the first few with every program passed on."""
    outcomes: Counter[str] = Counter()
    original = qp.fallback

    def counted(*arguments: Any) -> tuple[int, Array, Array]:
        answer = original(*arguments)
        outcomes[("solved", "infeasible", "failed")[answer[0]]] += 1
        return answer

    drawn = [np.random.default_rng(seed) for seed in range(tasks)]
    problems = [floor_task(rng, facets=int(rng.integers(4, 7)), steps=5) for rng in drawn]
    few = problems[: max(tasks // 40, 1)]
    warm_up()
    qp.fallback = counted
    try:
        ours = seconds(lambda: [solve(task, node_limit=2000) for task in problems])
        passed_on = dict(outcomes)
        same = seconds(lambda: [solve(task, node_limit=20) for task in few])
        scaled.QP_ITERATIONS = 0
        theirs = seconds(lambda: [solve(task, node_limit=20) for task in few])
    finally:
        qp.fallback, scaled.QP_ITERATIONS = original, 400
    return {"tasks": tasks, "ours": ours, "passed_on": passed_on, "slowdown": theirs / same}


def cages() -> dict[str, float]:
    """Processor time [s] of one cage by each mixed-integer solver."""
    task = read_problem(CAGE).task
    found = {}
    for solver in ("highs", "scip"):
        began = time.process_time()
        answer = find_cage(task, solver=solver, time_limit=20.0)  # type: ignore[arg-type]
        found[solver] = time.process_time() - began if answer.status == "caged" else np.inf
    return found


def missed(rows: list[dict[str, Any]], search: dict[str, Any], cage: dict[str, float]) -> list[str]:
    """Bars that were not met."""
    slow = [
        f"{name} at {row['variables']} variables"
        for row in rows[:2]
        for name in installed()
        if row[name] < 3 * row["ours"]
    ]
    bars = {
        f"less than 3 times faster than {', '.join(slow)}": bool(slow),
        "a program was left unsettled": "failed" in search["passed_on"],
        "the search does without our method": search["slowdown"] < 3,
        "SCIP is faster on the cage": cage["scip"] < cage["highs"],
    }
    return [what for what, bad in bars.items() if bad]


def main() -> int:
    """Print the tables; 1 where a bar is missed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="few programs, 40 tasks")
    parser.add_argument("--tasks", type=int, default=200)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    rows = timings(*((20, 20) if options.quick else (200, 100)))
    search = searches(min(options.tasks, 40) if options.quick else options.tasks)
    cage = cages()
    table = Table("variables", "ours", *installed(), title="processor time of a program, median [us]")
    for row in rows:
        table.add_row(*(f"{value:.0f}" for value in row.values()))
    console = Console()
    console.print(table)
    console.print(f"{search['tasks']} contact tasks; programs passed on: {search['passed_on'] or 'none'}")
    console.print(f"search without our method: {search['slowdown']:.0f} times slower")
    console.print(f"cage of {CAGE.stem}: HiGHS {cage['highs']:.2f} s, SCIP {cage['scip']:.2f} s")
    if options.json:
        content = {"timings": rows, "search": search, "cage": cage}
        options.json.write_text(json.dumps(content, indent=1))
    faults = missed(rows, search, cage)
    console.print("bars met" if not faults else f"bars missed: {'; '.join(faults)}")
    return int(bool(faults))


if __name__ == "__main__":
    sys.exit(main())
