"""Fuzz of the cage verifier: no contradiction between CAGED, ESCAPES, a random refuter, invariances and monotonicity.

    python -m tests.benchmarks.cage_verifier [--quick] [--hard] [--cases 10000] [--first 0] [--json FILE]

Bars: no contradiction; median <= 20 ms and p99 <= 1 s of processor time per verification (other load does not count).
--hard: slivers, combs, gears, spirals and rings in turn instead; bars: no contradiction, and at most 3 % of them unknown.
"""

import argparse
import itertools
import json
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np
import shapely
from rich.console import Console
from rich.progress import track
from rich.table import Table

from expert.geometry.pose import Array, to_world
from expert.problems.cage import Arrangement
from expert.verify.cage.check import verify_cage
from expert.verify.cage.escape import escape_fault
from expert.verify.cage.report import CageReport
from tests.support.arrangements import hard_arrangement, random_arrangement, transformed, with_finger
from tests.support.polygons import HARD
from tests.support.refuter import random_escape

MEDIAN_BAR, P99_BAR, UNKNOWN_BAR = 0.020, 1.0, 0.03


def contradictions(seed: int, arrangement: Arrangement, report: CageReport) -> list[str]:
    """Everything that cannot be true together with the verdict."""
    rng = np.random.default_rng([seed, 1])
    if report.verdict == "escapes":
        fault = escape_fault(arrangement, report.path) or sampled_fault(arrangement, report.path)
        found = [f"path refused: {fault}"] if fault else []
    else:
        refuted = random_escape(arrangement, rng, nodes=1500) is not None
        found = ["caged, but the refuter escaped"] if refuted and report.verdict == "caged" else []
    if seed % 2 == 0:
        again = verify_cage(transformed(arrangement, rng)).verdict
        if {again, report.verdict} == {"caged", "escapes"}:
            found.append(f"{report.verdict}, but {again} when moved, scaled or mirrored")
    elif report.verdict == "caged" and verify_cage(with_finger(arrangement, rng)).verdict == "escapes":
        found.append("caged, but escapes with one more finger")
    return found


def sampled_fault(arrangement: Arrangement, path: Array) -> str | None:
    """A third, plain check: the polygon itself at poses along the path, fingers and walls outside it."""
    fingers, walls = shapely.points(arrangement.fingers), shapely.linestrings(arrangement.wall_ends)
    depth = 2e-7 * arrangement.shape.size
    for a, b in itertools.pairwise(path):
        for pose in _between(a, b, 7):
            core = shapely.Polygon(to_world(pose, arrangement.shape.vertices)).buffer(
                -depth, join_style="mitre"
            )
            if shapely.intersects(core, fingers).any() or shapely.intersects(core, walls).any():
                return f"sampled collision near {pose.tolist()}"
    return None


def _between(a: Array, b: Array, count: int) -> Array:
    """Poses of a translation, or of the rotation about the displacement's fixed point."""
    s = np.linspace(0, 1, count)[:, None]
    angle = b[2] - a[2]
    if angle == 0:
        return a + s * (b - a)
    half = (b[:2] - a[:2]) / 2
    pole = (a[:2] + b[:2]) / 2 + np.array([-half[1], half[0]]) / np.tan(angle / 2)
    z = complex(*(a[:2] - pole)) * np.exp(1j * s[:, 0] * angle)
    return np.column_stack([pole[0] + z.real, pole[1] + z.imag, a[2] + s[:, 0] * angle])


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="300 cases")
    parser.add_argument("--hard", action="store_true", help="families that are hard to decide")
    parser.add_argument("--cases", type=int, default=10_000)
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    count = 300 if options.quick else options.cases
    verdicts: Counter[str] = Counter()
    undecided: Counter[str] = Counter()
    seconds, failures = [], []
    verify_cage(random_arrangement(np.random.default_rng(10**9)))  # compile
    began = time.perf_counter()
    console = Console(stderr=True)
    seeds = range(options.first, options.first + count)
    for seed in track(seeds, "verifying", console=console, disable=not console.is_terminal):
        arrangement = _arrangement(seed, options.hard)
        started = time.process_time()
        report = verify_cage(arrangement)
        seconds.append(time.process_time() - started)
        verdicts[report.verdict] += 1
        if options.hard and report.verdict == "unknown":
            undecided[HARD[seed % len(HARD)]] += 1
        failures += [f"seed {seed}: {text}" for text in contradictions(seed, arrangement, report)]
    result = {
        "cases": count,
        "verdicts": dict(verdicts),
        "unknown_by_family": dict(undecided),
        "contradictions": failures,
        "median_seconds": float(np.median(seconds)),
        "p95_seconds": float(np.quantile(seconds, 0.95)),
        "p99_seconds": float(np.quantile(seconds, 0.99)),
        "max_seconds": float(np.max(seconds)),
        "wall_seconds": time.perf_counter() - began,
    }
    _print(result)
    if options.json:
        options.json.write_text(json.dumps(result, indent=1))
    fast = result["median_seconds"] <= MEDIAN_BAR and result["p99_seconds"] <= P99_BAR
    decided = verdicts["unknown"] <= UNKNOWN_BAR * count
    return 0 if (decided if options.hard else fast) and not failures else 1


def _arrangement(seed: int, hard: bool) -> Arrangement:
    rng = np.random.default_rng(seed)
    return hard_arrangement(rng, HARD[seed % len(HARD)]) if hard else random_arrangement(rng)


def _print(result: dict) -> None:
    table = Table("quantity", "value", "bar", title="cage verifier")
    table.add_row("cases", str(result["cases"]), "")
    for verdict, number in sorted(result["verdicts"].items()):
        table.add_row(verdict, str(number), "")
    for family, number in sorted(result["unknown_by_family"].items()):
        table.add_row(f"unknown: {family}", str(number), "")
    table.add_row("contradictions", str(len(result["contradictions"])), "0")
    table.add_row("median", f"{1e3 * result['median_seconds']:.1f} ms", f"{1e3 * MEDIAN_BAR:.0f} ms")
    table.add_row("p95", f"{1e3 * result['p95_seconds']:.0f} ms", "")
    table.add_row("p99", f"{1e3 * result['p99_seconds']:.0f} ms", f"{1e3 * P99_BAR:.0f} ms")
    table.add_row("max", f"{result['max_seconds']:.2f} s", "")
    console = Console()
    console.print(table)
    for line in result["contradictions"][:20]:
        console.print(line)


if __name__ == "__main__":
    sys.exit(main())
