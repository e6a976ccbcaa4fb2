"""How long data sets take to make: draws, labels, checks, frames, storage, with two processes.

    python -m tests.benchmarks.generation [--quick] [--jobs 2] [--json FILE]

Bars: 10,000 tasks of the training distribution within 30 minutes; no plan that the checker refutes; at least 90 % of the
draws of each distribution feasible.
"""

import argparse
import json
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from datasets.generation import Generation, generate
from datasets.shapes import Shapes
from datasets.specification import Specification

DISTRIBUTIONS = {"4 to 6 facets": Shapes(), "12 facets": Shapes(facets=(12, 12))}
TASKS_BAR, MINUTES_BAR, FEASIBLE_BAR = 10_000, 30.0, 0.90


def measure(shapes: Shapes, count: int, jobs: int, folder: Path) -> dict[str, Any]:
    """Make a data set and tell its rate; the first tasks, which load and compile, do not count."""
    warm = Specification(name="warm", count=jobs, shard=1, shapes=shapes)
    generate(Generation(specification=warm, seed=0, out=folder / "warm", jobs=jobs))
    specification = Specification(name="timed", count=count, shard=5, shapes=shapes)
    start = time.perf_counter()
    manifest = generate(Generation(specification=specification, seed=0, out=folder / "timed", jobs=jobs))
    seconds = time.perf_counter() - start
    return {
        "tasks": count,
        "seconds": seconds,
        "minutes_per_10000": seconds / count * TASKS_BAR / 60,
        "feasible": 1 - manifest["failures"].get("infeasible", 0) / manifest["draws"],
        "optimal": manifest["statuses"].get("optimal", 0) / count,
        "failures": manifest["failures"],
        "bytes_per_task": sum(shard["bytes"] for shard in manifest["shards"]) / count,
    }


def missed(rows: dict[str, dict[str, Any]]) -> list[str]:
    """The bars that are not met, in words."""
    first = next(iter(rows.values()))
    misses = [
        f"{name}: plans refuted by the checker" for name, r in rows.items() if "unsound" in r["failures"]
    ]
    misses += [
        f"{name}: feasible {r['feasible']:.3f}" for name, r in rows.items() if r["feasible"] < FEASIBLE_BAR
    ]
    if first["minutes_per_10000"] > MINUTES_BAR:
        misses.append(f"{first['minutes_per_10000']:.0f} minutes for {TASKS_BAR} tasks")
    return misses


def main() -> None:
    """Print the table; exit 1 where a bar is missed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    count = 60 if arguments.quick else 600
    rows = {}
    for name, shapes in DISTRIBUTIONS.items():
        with tempfile.TemporaryDirectory() as folder:
            rows[name] = measure(shapes, count, arguments.jobs, Path(folder))
    table = Table(
        "objects", "tasks", "s", "min per 10,000", "feasible draws", "optimal", "kB per task", "failures"
    )
    for name, r in rows.items():
        numbers = (
            f"{r['seconds']:.1f}",
            f"{r['minutes_per_10000']:.1f}",
            f"{r['feasible']:.3f}",
            f"{r['optimal']:.3f}",
        )
        table.add_row(
            name, str(r["tasks"]), *numbers, f"{r['bytes_per_task'] / 1000:.1f}", str(r["failures"])
        )
    Console(width=120).print(table)
    if arguments.json:
        arguments.json.write_text(json.dumps(rows, indent=1) + "\n")
    if misses := missed(rows):
        sys.exit("missed: " + "; ".join(misses))


if __name__ == "__main__":
    main()
