"""Every problem of configs/problem/cage: solved and verified, processor times, costs.

    python -m tests.benchmarks.cage_files [--quick] [--json FILE] [NAME ...]

Bars: each answer verified; walls, fixed fingers and grippers within 10 s of processor time, solving and verifying.  --quick leaves
out the costs, which use their whole time limit, and all but three random polygons.
"""

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import track
from rich.table import Table

from expert.caging.synthesis import solve
from expert.files import read_problem
from expert.problems.cage import Arrangement, CageProblem
from expert.verify.cage.check import verify

FOLDER = Path("configs/problem/cage")
RESTRICTED_BAR = 10.0
TIME_LIMIT = 120.0
"""Of the clock [s], on a machine that may be shared, where there is no cost."""


def run(path: Path) -> dict[str, Any] | None:
    """Solve and verify one file; None where its fingers are given."""
    problem = read_problem(path)
    task = problem.task
    if isinstance(task, Arrangement):
        return None
    assert isinstance(task, CageProblem)
    options = dict(problem.options)
    if task.cost == "none":
        options["time_limit"] = TIME_LIMIT
    began = time.process_time()
    answer = solve(task, **options)
    verdict = verify(task, answer).verdict if answer.found else "none"
    return {
        "name": path.stem,
        "restricted": bool(len(task.walls) or len(task.fixed) or task.grippers),
        "status": answer.status,
        "verdict": verdict,
        "seconds": time.process_time() - began,
        "attempts": answer.attempts,
        "refuted": answer.refuted,
        "cost": task.cost,
        "objective": answer.objective if task.cost != "none" else None,
    }


def meets_bar(row: dict[str, Any]) -> bool:
    slow = row["restricted"] and row["cost"] == "none" and row["seconds"] > RESTRICTED_BAR
    return row["verdict"] == "caged" and not slow


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", help="files to run, without their ending; all by default")
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    paths = sorted(FOLDER.glob("*.yaml"))
    if options.names:
        paths = [FOLDER / f"{name}.yaml" for name in options.names]
    if options.quick:
        paths = [
            p
            for p in paths
            if "cost:" not in p.read_text() and not ("random" in p.stem and p.stem > "random_02")
        ]
    console = Console(stderr=True)
    rows = []
    for path in track(paths, "files", console=console, disable=not console.is_terminal):
        row = run(path)
        if row is not None:
            rows.append(row)
            if options.json:
                options.json.write_text(json.dumps(rows, indent=1))
    _print(rows)
    return 0 if all(meets_bar(row) for row in rows) else 1


def _print(rows: list[dict[str, Any]]) -> None:
    table = Table(title="problem files of cages (processor seconds, solving and verifying)")
    for heading in ("file", "verdict", "seconds", "attempts", "refuted", "cost", "bar"):
        table.add_column(heading)
    for row in rows:
        cost = "" if row["objective"] is None else f"{row['cost']} {row['objective']:.4g}"
        bar = "met" if meets_bar(row) else "MISSED"
        counts = (str(row["attempts"]), str(row["refuted"]))
        table.add_row(row["name"], row["verdict"], f"{row['seconds']:.2f}", *counts, cost, bar)
    Console(width=100).print(table)


if __name__ == "__main__":
    sys.exit(main())
