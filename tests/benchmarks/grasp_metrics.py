"""Certified grasps on supports that change all the time: every start in Q0 must end at the goal, whatever the support resists.

    python -m tests.benchmarks.grasp_metrics [--quick] [--runs 10000] [--json FILE]

A certificate speaks of any positive definite support metric, random and different in each of many pieces of the finger path here
(forces resist translations up to 50 times as much in one direction as in another, and turns likewise, coupled).
Bar: all executions arrive.
"""

import argparse
import itertools
import json
import sys
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from expert.files import read_problem
from expert.geometry.pose import Array, wrapped
from expert.grasping.sweeping import NEAR, TURNED, sweep
from expert.kinds import KINDS
from expert.problems.grasp import GraspProblem, GraspSolution
from expert.verify.grasp.check import verify_grasp

FILES = ("t", "hourglass_3", "bracket", "random_06", "t_grippers")
FOLDER = Path(__file__).resolve().parents[2] / "configs" / "problem" / "certified_grasp"
PIECES = 4
"""Of each straight stretch of the finger path, on average, each on another support."""
TOGETHER = 50
"""Executions on the same supports."""


def random_metric(rng: np.random.Generator) -> Array:
    """Positive definite form (3, 3) of twists (vx, vy [over the diameter], omega), anything but isotropic."""
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    scale = np.diag([1.0, 1.0, rng.uniform(0.1, 0.6)])
    return scale @ turn @ np.diag(np.exp(rng.uniform(-2, 2, 3))) @ turn.T @ scale


def misses(task: GraspProblem, answer: GraspSolution, starts: Array, rng: np.random.Generator) -> int:
    """How many of the executions do not end at the goal, the support changing at random places of the path.

    Those that stall stay where they are: within the tolerance of the goal, as free space vanishes there, or far from it.
    """
    last = len(answer.path) - 1
    cuts = np.unique([0, last, *range(1, last), *rng.uniform(0, last, (PIECES - 1) * last)])
    moving, ends = starts, []
    for low, high in itertools.pairwise(cuts):
        piece = np.stack([answer.fingers(low), answer.fingers(high)])
        done = sweep(task.shape, piece, moving, goal=task.pose, metric=random_metric(rng), samples=1)
        stalled = np.isfinite(done.stalled)
        ends.append(done.ends[stalled])
        moving = done.ends[~stalled]
        if not len(moving):
            break
    off = np.concatenate([*ends, moving]) - task.pose
    far = np.linalg.norm(off[:, :2], axis=1) > NEAR * task.shape.size
    return int((far | (np.abs(wrapped(off[:, 2])) > TURNED)).sum())


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="two grasps, 200 runs")
    parser.add_argument("--runs", type=int, default=10_000)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    files, runs = (FILES[1:3], 200) if options.quick else (FILES, options.runs)
    console = Console(stderr=True)
    rows = []
    for name in files:
        problem = read_problem(FOLDER / f"{name}.yaml")
        answer = KINDS[problem.kind].solve(problem.task, **problem.options)
        report = verify_grasp(problem.task, answer.path, answer.facets)
        if not report.certified or report.start is None:
            rows.append({"grasp": name, "verdict": report.verdict, "runs": 0, "missed": 0})
            continue
        rng, missed, done = np.random.default_rng(len(rows)), 0, 0
        rounds = range(-(-runs // (TOGETHER * len(files))))
        for _ in track(rounds, name, console=console, disable=not console.is_terminal):
            missed += misses(problem.task, answer, report.start.starts(rng, TOGETHER), rng)
            done += TOGETHER
        rows.append({"grasp": name, "verdict": report.verdict, "runs": done, "missed": missed})
    table = Table(
        "grasp", "verdict", "runs", "missed (bar 0)", title="certified grasps, supports that change"
    )
    for row in rows:
        table.add_row(*(str(row[key]) for key in ("grasp", "verdict", "runs", "missed")))
    Console().print(table)
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1))
    return int(any(row["missed"] or row["verdict"] != "certified" for row in rows))


if __name__ == "__main__":
    sys.exit(main())
