"""Cage synthesis: share found and verified, processor times, on seeded random polygons and the named shapes.

    python -m tests.benchmarks.caging [--quick] [--polygons 100] [--method swept|model] [--json FILE]

Bars: N = 3 and N = 4 on random polygons of 4-10 facets >= 98 %, median <= 0.5 s, max <= 20 s; N = 2 on 20 non-convex
polygons >= 50 %; all named shapes with 3 and 4 fingers.  Every answer is verified once more here, after a rigid motion.
"""

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from expert.caging.problem import Arrangement, CageProblem, Shape
from expert.caging.shapes import NAMES, named_shape, random_nonconvex_polygon, random_polygon
from expert.caging.solution import CageSolution
from expert.caging.synthesis import solve
from expert.geometry.pose import Array, to_world
from expert.verify.cage import verify_cage

SHARE_BAR, MEDIAN_BAR, MAX_BAR, PAIR_BAR = 0.98, 0.5, 20.0, 0.5
TIME_LIMIT = 40.0


def false_cage(problem: CageProblem, answer: CageSolution) -> bool:
    """Whether an answer that claims a cage is refuted when everything is moved rigidly."""
    motion = np.array([0.3, -0.1, 0.7])
    origin = to_world(motion, problem.pose[None, :2])[0]
    moved = Arrangement(
        shape=problem.shape,
        pose=np.append(origin, problem.pose[2] + motion[2]),
        fingers=to_world(motion, answer.fingers),
    )
    return verify_cage(moved).verdict == "escapes"


def run(name: str, shapes: list[Array], count: int, method: str, limit: float) -> dict[str, Any]:
    """Solve for each shape and summarise."""
    console = Console(stderr=True)
    seconds, missed, false, refuted = [], [], 0, 0
    for k, vertices in enumerate(track(shapes, name, console=console, disable=not console.is_terminal)):
        problem = CageProblem(shape=Shape(vertices=vertices), pose=np.zeros(3), count=count)
        began = time.process_time()
        answer = solve(problem, time_limit=limit, method=method)  # type: ignore[arg-type]
        seconds.append(time.process_time() - began)
        refuted += answer.refuted
        if not answer.found:
            missed.append(k)
        elif false_cage(problem, answer):
            false += 1
    return {
        "case": name,
        "fingers": count,
        "objects": len(shapes),
        "verified": len(shapes) - len(missed),
        "missed": missed,
        "false_cages": false,
        "refuted_answers": refuted,
        "median_seconds": float(np.median(seconds)),
        "max_seconds": float(np.max(seconds)),
    }


def meets_bar(row: dict[str, Any]) -> bool:
    share = row["verified"] / row["objects"]
    if row["false_cages"]:
        return False
    if row["case"] == "non-convex":
        return share >= PAIR_BAR
    if row["case"] == "named":
        return share == 1.0
    return share >= SHARE_BAR and row["median_seconds"] <= MEDIAN_BAR and row["max_seconds"] <= MAX_BAR


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="12 random polygons")
    parser.add_argument("--polygons", type=int, default=100)
    parser.add_argument("--method", default="swept", choices=("swept", "model"))
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    number, limit = (12, 8.0) if options.quick else (options.polygons, TIME_LIMIT)
    polygons = [random_polygon(np.random.default_rng(k), 4 + k % 7) for k in range(number)]
    pocketed = [random_nonconvex_polygon(np.random.default_rng(k), 5 + k % 6) for k in range(min(number, 20))]
    named = [named_shape(name) for name in NAMES]
    cases = [("random", polygons, 3), ("random", polygons, 4), ("non-convex", pocketed, 2)]
    cases += [] if options.quick else [("named", named, 3), ("named", named, 4)]
    rows = []
    for name, shapes, count in cases:
        rows.append(run(name, shapes, count, options.method, 4.0 if count == 2 else limit))
        if options.json:
            options.json.write_text(json.dumps({"method": options.method, "rows": rows}, indent=1))
    _print(rows, options.method)
    return 0 if all(meets_bar(row) for row in rows) else 1


def _print(rows: list[dict[str, Any]], method: str) -> None:
    table = Table(title=f"cage synthesis, method {method} (processor seconds)")
    for heading in ("objects", "N", "verified", "false", "refuted", "median", "max", "bar"):
        table.add_column(heading)
    for row in rows:
        table.add_row(
            row["case"],
            str(row["fingers"]),
            f"{row['verified']}/{row['objects']}",
            str(row["false_cages"]),
            str(row["refuted_answers"]),
            f"{row['median_seconds']:.2f}",
            f"{row['max_seconds']:.1f}",
            "met" if meets_bar(row) else "MISSED",
        )
    Console().print(table)


if __name__ == "__main__":
    sys.exit(main())
