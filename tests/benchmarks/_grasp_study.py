"""What the benchmarks of grasping share: objects, their certified grasps, and the command line that prints tables and bars."""

import argparse
import json
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from expert.geometry.pose import Array, to_world
from expert.grasping.sweeping import sweep
from expert.grasping.synthesis import solve
from expert.problems.grasp import GraspProblem, GraspSolution, schedule
from expert.verify.grasp.check import verify_grasp
from expert.verify.grasp.report import GraspReport
from expert.world.named import named_shape
from expert.world.shape import Shape
from tests.support.polygons import GRASPED, irregular_polygon

QUIET = Console(stderr=True)
TIME_LIMIT = 300.0
"""Of the clock [s]: generous, so that other load does not count."""
Row = dict[str, Any]
Bars = dict[str, bool]


class Study:
    """Objects, and certified grasps found so far: later parts use what the first has found."""

    def __init__(self, quick: bool) -> None:
        self.quick = quick
        numbers = range(3) if quick else range(12)
        self.random = {
            f"polygon {k}": irregular_polygon(np.random.default_rng(k), 4 + k % 3) for k in numbers
        }
        self.named = {name: named_shape(name) for name in (GRASPED[:2] if quick else GRASPED)}
        self.found: dict[tuple[str, float], tuple[GraspProblem, GraspSolution]] = {}
        self.seconds: dict[tuple[str, float], float] = {}

    @property
    def objects(self) -> dict[str, Array]:
        """All of them by name, vertices (V, 2)."""
        return {**self.named, **self.random}

    def grasp(self, name: str, degrees: float = 15.0) -> tuple[GraspProblem, GraspSolution]:
        """The answer for one object, solved once."""
        if (name, degrees) not in self.found:
            problem = task(self.objects[name], degrees)
            began = time.process_time()
            self.found[name, degrees] = problem, solve(problem, time_limit=TIME_LIMIT)
            self.seconds[name, degrees] = time.process_time() - began
        return self.found[name, degrees]

    def certified(self) -> list[tuple[str, GraspProblem, GraspSolution]]:
        """Objects with a certified grasp at 15 deg."""
        answers = [(name, *self.grasp(name)) for name in watched(self.objects, "solving")]
        return [row for row in answers if row[2].found]


Part = Callable[[Study], tuple[list[Row], Bars]]


def task(vertices: Array, degrees: float = 15.0, **options: Any) -> GraspProblem:
    """The object at the origin."""
    ranges = np.radians(schedule(degrees))
    return GraspProblem(shape=Shape(vertices=vertices), pose=np.zeros(3), half_ranges=ranges, **options)


def moved_report(problem: GraspProblem, answer: GraspSolution) -> GraspReport:
    """The checker's report on everything moved rigidly."""
    motion = np.array([0.3, -0.1, 0.7])
    origin = to_world(motion, problem.pose[None, :2])[0]
    moved = replace(problem, pose=np.append(origin, problem.pose[2] + motion[2]))
    return verify_grasp(moved, to_world(motion, answer.path), answer.facets)


@dataclass(frozen=True)
class Arrivals:
    """Executions (M,): which end at the goal, and how far the worst is off, over the object's size and in degrees."""

    arrived: np.ndarray
    worst_distance: float
    worst_angle: float


def arrivals(problem: GraspProblem, path: Array, starts: Array) -> Arrivals:
    """Of the sweeping process from starts (M, 3)."""
    runs, size = sweep(problem.shape, path, starts, goal=problem.pose), problem.shape.size
    distance, angle = runs.misses(problem.pose)
    worst = float(distance.max() / size), float(np.degrees(angle.max()))
    return Arrivals(runs.arrived(problem.pose, size), *worst)


def watched(items: Iterable[Any], what: str, total: int | None = None) -> Iterable[Any]:
    """The items, with a bar of progress where somebody looks; total: how many, where they have no length."""
    return track(items, what, total, console=QUIET, disable=not QUIET.is_terminal)


def run(parts: dict[str, Part], text: str) -> int:
    """Read the command line, run the parts asked for, and return 1 where a bar is missed."""
    parser = argparse.ArgumentParser(description=text.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="few objects, few starts")
    parser.add_argument("--only", nargs="+", choices=parts, help="these parts alone")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    study = Study(options.quick)
    result: dict[str, dict[str, Any]] = {}
    for name in options.only or parts:
        began = time.process_time()
        rows, bars = parts[name](study)
        seconds = time.process_time() - began
        result[name] = {"rows": rows, "bars": bars, "seconds": seconds}
        _print(f"{name}, {seconds:.0f} s", rows, bars)
        if options.json:
            options.json.write_text(json.dumps(result, indent=1, default=float))
    return 0 if all(met for part in result.values() for met in part["bars"].values()) else 1


def _print(title: str, rows: list[Row], bars: Bars) -> None:
    columns = list(dict.fromkeys(key for row in rows for key in row))
    table = Table(title=title)
    for column in columns:
        table.add_column(column)
    for row in rows:
        table.add_row(*(_cell(row.get(column)) for column in columns))
    Console(width=200).print(table)
    for bar, met in bars.items():
        print(f"{'met   ' if met else 'MISSED'}  {bar}")


def _cell(value: Any) -> str:
    if isinstance(value, dict):
        return " ".join(_cell(v) for v in value.values())
    if isinstance(value, float):
        return f"{value:.3g}"
    return "" if value is None else str(value)
