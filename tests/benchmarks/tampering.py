"""Solution files in which one value was changed: none of them may be confirmed, unless what it says is still true.

    python -m tests.benchmarks.tampering [--quick] [--files 10000] [--first 0] [--json FILE]

Of ten files eight are contact plans and proofs that there is none, one or two cages, one in fifty a grasp, solved first.  A value is a lie
where the report does not list its field as claimed, unless it is within RESOLUTION of the true one.  Cages whose fingers were
moved and grasps whose path was are judged by others: a random tree search that must not escape, executions that must arrive.
A certificate that still proves what the file says is none.
Bar: no lie is accepted.
"""

import argparse
import copy
import json
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from expert.errors import InvalidProblem
from expert.files import read_problem, solution_fields, solution_of
from expert.grasping.sweeping import sweep
from expert.kinds import KINDS
from tests.support.refuter import random_escape

FOLDER = Path(__file__).resolve().parents[2] / "configs" / "problem"
FILES = {
    "contact_trajectory": (
        "block_pivot_two_fingers", "block_slide_one_finger", "transverse_rotation_two_fingers",
        "triangle_pivot_two_fingers", "tee_lift_two_fingers", "block_lift_one_finger_infeasible", "tool_pivot_one_finger",
    ),
    "cage": ("i_3", "t_wall", "m_grippers", "hourglass_min"),
    "certified_grasp": ("hourglass_3",),
}  # fmt: skip
SHARES = {"contact_trajectory": 0.84, "cage": 0.14, "certified_grasp": 0.02}
CONFIRMED = ("sound", "caged", "certified")
TRUE_ALIKE = (["status", "feasible"], ["status", "uncertified"])
"""What says less than the truth."""
RESOLUTION = 1e-8
"""Numbers [SI] that differ by less say the same: a residual of 1e-16 is one of 2e-16, which rounding decides."""


def tampered(data: dict[str, Any], rng: np.random.Generator) -> tuple[dict[str, Any], str]:
    """A copy with one value changed, and the field in which it was."""
    copied = copy.deepcopy(data)
    field = str(rng.choice(sorted(copied.keys() - {"problem"})))
    place: Any = copied
    key: Any = field
    while isinstance(place[key], list | dict) and place[key]:
        place = place[key]
        key = rng.choice(sorted(place)) if isinstance(place, dict) else int(rng.integers(len(place)))
    place[key] = another(place[key], rng)
    return copied, field


def alike(a: Any, b: Any) -> bool:
    """The same but for RESOLUTION of each number."""
    if isinstance(a, float) and isinstance(b, float):
        return abs(a - b) <= RESOLUTION
    if isinstance(a, list) and isinstance(b, list):
        return len(a) == len(b) and all(map(alike, a, b))
    if isinstance(a, dict) and isinstance(b, dict):
        return a.keys() == b.keys() and all(alike(a[key], b[key]) for key in a)
    return bool(a == b)


def another(value: Any, rng: np.random.Generator) -> Any:
    """Something else of the same kind."""
    if isinstance(value, bool) or value is None:
        return int(rng.integers(4))
    if isinstance(value, int):
        return int(value + rng.choice([-2, -1, 1, 2, 7]))
    if isinstance(value, float):
        change = 10.0 ** rng.uniform(-3, 3)
        options = (value * (1 + change), value - change, value + change, -value - change)
        return float(options[rng.integers(len(options))])
    if isinstance(value, str):
        words = (
            "optimal",
            "feasible",
            "infeasible",
            "caged",
            "certified",
            "uncertified",
            "time_limit",
            "none_found",
            "",
        )
        return str(rng.choice([word for word in words if word != value]))
    return [0.0]


def is_lie(
    field: str, told: dict[str, Any], true: dict[str, Any], report: Any, rng: np.random.Generator
) -> bool:
    """Whether what was confirmed is false, by other means where the change alone does not say so."""
    if field in report.claimed or [field, told[field]] in TRUE_ALIKE or alike(told[field], true[field]):
        return False
    if field == "certificate":
        return False  # what it proves is true, however it does so
    solution = solution_of(told)
    task, answer = solution.problem.task, solution.answer
    if field == "rotation_range":
        return (
            report.rotation_range[0] < told[field][0] - 1e-6
            or report.rotation_range[1] > told[field][1] + 1e-6
        )
    if field == "fingers":
        return random_escape(task.arrangement(answer.fingers), rng, nodes=3000) is not None
    if field == "path":
        starts = report.start.starts(rng, 30)
        return (
            not sweep(task.shape, answer.path, starts, goal=task.pose)
            .arrived(task.pose, task.shape.size)
            .all()
        )
    return True


def judge(data: dict[str, Any], true: dict[str, Any], field: str, rng: np.random.Generator) -> str:
    """refused, not confirmed, claimed, true, or LIE."""
    try:
        solution = solution_of(data)
        report = KINDS[solution.problem.kind].verify(solution.problem.task, solution.answer)
    except InvalidProblem:
        return "refused"
    if report.verdict not in CONFIRMED:
        return "not confirmed"
    if is_lie(field, data, true, report, rng):
        return "LIE"
    return "claimed" if field in report.claimed else "true"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="300 files")
    parser.add_argument("--files", type=int, default=10_000)
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    count = 300 if options.quick else options.files
    solved = {kind: [_solved(kind, name) for name in names] for kind, names in FILES.items()}
    outcomes: Counter[tuple[str, str]] = Counter()
    accepted: list[str] = []
    console = Console(stderr=True)
    seeds = range(options.first, options.first + count)
    for seed in track(seeds, "tampering", console=console, disable=not console.is_terminal):
        rng = np.random.default_rng(seed)
        kind = str(rng.choice(list(SHARES), p=list(SHARES.values())))
        true = solved[kind][rng.integers(len(solved[kind]))]
        data, field = tampered(true, rng)
        outcome = judge(data, true, field, rng)
        outcomes[kind, outcome] += 1
        if outcome == "LIE":
            accepted.append(f"seed {seed}: {kind}, {field}")
    table = Table(
        "kind", "outcome", "files", title=f"{count} tampered files, accepted lies: {len(accepted)} (bar 0)"
    )
    for (kind, outcome), number in sorted(outcomes.items()):
        table.add_row(kind, outcome, str(number))
    Console().print(table)
    for line in accepted[:20]:
        Console().print(line)
    if options.json:
        result = {
            "files": count,
            "outcomes": {f"{k}: {o}": n for (k, o), n in outcomes.items()},
            "lies": accepted,
        }
        options.json.write_text(json.dumps(result, indent=1))
    return int(bool(accepted))


def _solved(kind: str, name: str) -> dict[str, Any]:
    problem = read_problem(FOLDER / kind / f"{name}.yaml")
    answer = KINDS[kind].solve(problem.task, **problem.options)
    return json.loads(json.dumps(solution_fields(problem, answer)))


if __name__ == "__main__":
    sys.exit(main())
