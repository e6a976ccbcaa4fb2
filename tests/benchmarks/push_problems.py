"""Random problems of `problem: push`: how many are solved, how long does it take, and does the checker agree with the solver?

    python -m tests.benchmarks.push_problems [--quick] [--count 24] [--json FILE]

A T, a box or a triangle of 8 to 10 cm, uniform pressure or an ellipsoid, a disc or a point, friction up to .5, none to two square
posts of 3 cm; goals up to 25 cm and half a turn away.  Exits 1 where a stated bar is missed.
"""

import argparse
import json
import sys
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from expert.errors import InvalidProblem
from expert.problems.push import Finger, LimitSurface, PushProblem
from expert.pushing.synthesis import solve
from expert.verify.push.check import verify
from expert.world.shape import Shape
from expert.world.walls import Obstacle

SHAPES = (
    0.01 * np.array([[-1, -5], [1, -5], [1, 1], [5, 1], [5, 3], [-5, 3], [-5, 1], [-1, 1]]),
    0.01 * np.array([[-4, -2.5], [4, -2.5], [4, 2.5], [-4, 2.5]]),
    0.01 * np.array([[-4, -3], [5, -2], [0, 5]]),
)
POST = 0.015 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
BARS = [("solved without posts", ">=", 0.9), ("refuted", "<=", 0.0)]


def problem(seed: int) -> PushProblem:
    """The first draw of a seed that is a problem."""
    rng = np.random.default_rng(seed)
    posts = seed % 3
    while True:
        ellipsoid = rng.random() < 0.5
        goal = np.array([*rng.uniform(-0.18, 0.18, 2), rng.uniform(-3.1, 3.1)])
        places = rng.uniform(-0.2, 0.2, (posts, 2))
        try:
            return PushProblem(
                shape=Shape(vertices=SHAPES[rng.integers(3)]),
                start=np.zeros(3),
                goal=goal,
                limit_surface=LimitSurface(kind="ellipsoid", c=0.028) if ellipsoid else LimitSurface(),
                finger=Finger(
                    start=np.array([-0.25, -0.25]),
                    radius=float(rng.choice([0.0, 0.006, 0.01])),
                    friction=float(rng.uniform(0, 0.5)),
                ),
                obstacles=tuple(Obstacle(vertices=POST + place) for place in places),
                workspace=np.array([-0.3, -0.3, 0.3, 0.3]),
            )
        except InvalidProblem:
            continue


def measured(count: int) -> dict[str, float]:
    """Shares and times."""
    free, posts, seconds, pushes, refuted, far = [], [], [], [], 0, 0.0
    for seed in range(count):
        task = problem(seed)
        plan = solve(task)
        (posts if task.obstacles else free).append(plan.found)
        seconds.append(plan.seconds)
        print(
            f"{seed}: {plan.status}, {len(plan.pushes)} pushes, {plan.seconds:.1f} s {plan.reason}",
            file=sys.stderr,
        )
        if plan.found:
            report = verify(task, plan)
            refuted += report.verdict != "sound"
            pushes.append(len(plan.pushes))
            far = max(far, report.checks[2].value)
    return {
        "problems": count,
        "solved without posts": float(np.mean(free)),
        "solved among posts": float(np.mean(posts)),
        "refuted": refuted,
        "pushes": float(np.median(pushes)),
        "seconds": float(np.median(seconds)),
        "most seconds": max(seconds),
        "claims off by [mm]": 1e3 * far,
    }


def main() -> int:
    """Measure, print, and say which bars are missed."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="6 problems")
    parser.add_argument("--count", type=int, default=24)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    found = measured(6 if options.quick else options.count)
    table = Table(*found)
    table.add_row(*(f"{value:.4g}" for value in found.values()))
    Console(width=150).print(table)
    missed = [
        f"{key} = {found[key]:.4g}, bar {relation} {limit:g}"
        for key, relation, limit in BARS
        if not (found[key] <= limit if relation == "<=" else found[key] >= limit)
    ]
    print("\n".join(missed) or "all bars hold")
    if options.json:
        options.json.write_text(json.dumps({"found": found, "missed": missed}, indent=1) + "\n")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
