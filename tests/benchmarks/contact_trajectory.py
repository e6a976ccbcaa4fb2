"""Contact trajectories: the exact solver on random tasks, all methods on the gallery, and two exact methods against each other.

    python -m tests.benchmarks.contact_trajectory [--quick] [--tasks 200] [--pairs 90] [--limit 60] [--json FILE]

Seconds are processor time of one thread, so that other load does not count.  Bars: random two-finger tasks with 4 to
6 facets all decided, mean <= 20 ms, p99 <= 300 ms; 12 facets mean <= 60 ms; ten-step gallery tasks <= 1 s each; on the
two-finger primitives at least 100 times faster (median) than the thesis's model in SCIP; every plan sound, every bound and
every infeasible answer of the exact solver proved again from its certificate; no contradiction between the exact solver and the
bilinear model in SCIP, and at least 60 agreements.
"""

import argparse
import json
import sys
import time
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from datasets.motions import FAMILIES, NoRoom, sample_task
from datasets.shapes import Shapes
from expert.contact import solve
from expert.contact.exact import warm_up
from expert.files import read_problem
from expert.problems.contact import ContactTask, Plan, Robustness
from expert.verify.plan.check import verify
from tests.support.random_tasks import floor_task, table_task

GALLERY = Path(__file__).parents[2] / "configs" / "problem" / "contact_trajectory"
PRIMITIVES = (
    "block_lift_two_fingers",
    "block_pivot_two_fingers",
    "triangle_pivot_two_fingers",
    "transverse_rotation_two_fingers",
)
GAP = 1e-3
ROBUST = Robustness(
    cone_fraction=0.7, support_inset=0.3, min_normal_force=0.03, min_interval=2, free_clearance=0.005
)
QUIET = Console(stderr=True)


@dataclass(frozen=True, kw_only=True)
class Run:
    """One answer: who gave it, what it says, what it and its check cost in processor time, and what the checker found wrong."""

    name: str
    method: str
    plan: Plan
    seconds: float
    checking: float
    faults: tuple[str, ...] = ()

    @property
    def decided(self) -> bool:
        """Solved to the gap, or proved infeasible."""
        return self.plan.status in ("optimal", "infeasible")

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        p = self.plan
        numbers = {
            "objective": p.objective,
            "bound": p.bound,
            "residual": p.residual,
            "seconds": self.seconds,
            "checking": self.checking,
        }
        finite = {key: float(value) if np.isfinite(value) else None for key, value in numbers.items()}
        return {
            "name": self.name,
            "method": self.method,
            "status": p.status,
            **finite,
            "faults": list(self.faults),
        }


@dataclass
class Bars:
    """Stated bars and what was measured."""

    rows: list[tuple[str, str, str, bool]] = field(default_factory=list)

    def most(self, what: str, value: float, limit: float, unit: str = "") -> None:
        """value <= limit."""
        self.rows.append((what, f"{value:.4g}{unit}", f"<= {limit:g}{unit}", bool(value <= limit)))

    def least(self, what: str, value: float, limit: float, unit: str = "") -> None:
        """value >= limit."""
        self.rows.append((what, f"{value:.4g}{unit}", f">= {limit:g}{unit}", bool(value >= limit)))


def run(name: str, task: ContactTask, method: str = "exact", time_limit: float = 60.0) -> Run:
    """Solve and check.  MIQP1's plans may break Newton-Euler (that is its envelope error), the others may break nothing."""
    start = time.process_time()
    plan = solve(task, method=method, gap=GAP, time_limit=time_limit)
    seconds = time.process_time() - start
    report = verify(task, plan)
    allowed = {"newton_euler"} if method == "thesis" else set()
    faults = tuple(str(check) for check in report.violations if check.name not in allowed)
    if method == "exact" and not faults and (report.verdict != "sound" or "bound" in report.claimed):
        faults = (f"{report.verdict}: {report.reason}",)
    return Run(name=name, method=method, plan=plan, seconds=seconds, checking=report.seconds, faults=faults)


def random_tasks(count: int, facets: tuple[int, int], *, robust: bool, seed: int) -> list[ContactTask]:
    """As the data sets draw them: two fingers, five steps, six families; with all margins, or with none."""
    rng, tasks = np.random.default_rng(seed), []
    while len(tasks) < count:
        try:
            task = sample_task(rng, list(FAMILIES)[len(tasks) % len(FAMILIES)], Shapes(facets=facets))
        except NoRoom:
            continue
        tasks.append(task if robust else replace(task, robustness=Robustness()))
    return tasks


def random_runs(count: int, facets: tuple[int, int]) -> dict[str, list[Run]]:
    """The exact solver on random tasks, by name of the group."""
    groups = {}
    for robust in (True, False):
        name = f"{'-'.join(map(str, sorted(set(facets))))} facets, {'with' if robust else 'no'} margins"
        tasks = random_tasks(count, facets, robust=robust, seed=facets[0])
        groups[name] = [run(f"{name} {i}", task) for i, task in watched(enumerate(tasks), count, name)]
    return groups


def gallery_runs(methods: Iterable[str], time_limit: float) -> list[Run]:
    """Each gallery task by each method."""
    files = sorted(GALLERY.glob("*.yaml"))
    jobs = [(file.stem, read_problem(file).task, method) for file in files for method in methods]
    return [run(name, task, method, time_limit) for name, task, method in watched(jobs, len(jobs), "gallery")]


def small_task(seed: int) -> ContactTask:
    """A task that SCIP solves in seconds: both planes, one or two fingers, with and without margins."""
    rng = np.random.default_rng([seed, 7])
    if seed % 4 == 3:
        return table_task(rng, facets=int(rng.integers(3, 5)), steps=2 + seed % 2, fingers=1 + seed % 8 // 4)
    fingers = 1 + seed % 2
    options = {"robustness": ROBUST} if seed % 3 == 0 else {"margin": 0.1 * (seed % 5 == 0)}
    return floor_task(
        rng, facets=int(rng.integers(3, 6)), steps=5 - 2 * (fingers - 1), fingers=fingers, **options
    )


def agreement_runs(count: int, time_limit: float) -> list[tuple[Run, Run]]:
    """Small random tasks by both exact methods."""
    return [
        tuple(run(f"small {seed}", task, method, time_limit) for method in ("exact", "scip"))
        for seed, task in watched(((seed, small_task(seed)) for seed in range(count)), count, "agreement")
    ]


def contradiction(a: Run, b: Run) -> str:
    """What cannot be true together: a plan below the other's bound (infeasible: bound inf); empty where there is nothing."""
    for upper, lower in ((a, b), (b, a)):
        slack = 1e-6 * max(1e-6, abs(upper.plan.objective)) if upper.plan.found else 0.0
        if upper.plan.found and (
            lower.plan.status == "infeasible" or upper.plan.objective < lower.plan.bound - slack
        ):
            return (
                f"{upper.name}: {upper.method} found {upper.plan.objective:.6g}, {lower.method} excludes it"
            )
    return ""


def watched(items: Iterable, total: int, what: str) -> Iterable:
    """Progress on a terminal."""
    return track(items, what, total=total, console=QUIET, disable=not QUIET.is_terminal)


def statistics(runs: list[Run]) -> dict[str, float]:
    """Median, mean, 99th percentile and largest seconds; verdicts; largest residual."""
    seconds = np.array([r.seconds for r in runs])
    status = [r.plan.status for r in runs]
    residuals = [r.plan.residual for r in runs if r.plan.found]
    return {
        "tasks": len(runs),
        "median": float(np.median(seconds)),
        "mean": float(seconds.mean()),
        "p99": float(np.quantile(seconds, 0.99)),
        "max": float(seconds.max()),
        "checking": float(np.mean([r.checking for r in runs])),
        **{word: status.count(word) for word in ("optimal", "infeasible", "feasible", "time_limit")},
        "residual": float(max(residuals, default=np.nan)),
    }


def ratio_to_thesis(gallery: list[Run]) -> float:
    """Median over the two-finger primitives of seconds of MIQP1 in SCIP over those of the exact solver.

    Where MIQP1 hit its limit, the ratio is a lower bound.
    """
    seconds = {(r.name, r.method): r.seconds for r in gallery}
    return float(np.median([seconds[name, "thesis"] / seconds[name, "exact"] for name in PRIMITIVES]))


def judge(
    few: dict[str, list[Run]],
    twelve: dict[str, list[Run]],
    gallery: list[Run],
    pairs: list[tuple[Run, Run]],
    wanted: int,
) -> Bars:
    """All bars."""
    bars = Bars()
    for name, runs in (few | twelve).items():
        s = statistics(runs)
        bars.most(f"{name}: undecided", sum(not r.decided for r in runs), 0)
        bars.most(f"{name}: mean", 1e3 * s["mean"], 20 if name in few else 60, " ms")
        if name in few:
            bars.most(f"{name}: p99", 1e3 * s["p99"], 300, " ms")
    exact = [r for r in gallery if r.method == "exact"]
    bars.most("gallery: undecided", sum(not r.decided for r in exact), 0)
    ten = [r.seconds for r in exact if read_problem(GALLERY / f"{r.name}.yaml").task.steps == 10]
    bars.most("gallery, T = 10: slowest", max(ten), 1.0, " s")
    bars.least("two-finger primitives: thesis / exact", ratio_to_thesis(gallery), 100)
    everything = [*(r for runs in (few | twelve).values() for r in runs), *gallery]
    everything += [r for pair in pairs for r in pair]
    bars.most("plans refuted by the checker", sum(bool(r.faults) for r in everything), 0)
    bars.most("contradictions", sum(bool(contradiction(*pair)) for pair in pairs), 0)
    bars.least("agreements with SCIP", sum(a.decided and b.decided for a, b in pairs), wanted)
    return bars


def random_table(groups: dict[str, list[Run]]) -> Table:
    """One row per set of random tasks."""
    table = Table(
        "tasks", "count", "median", "mean", "p99", "max", "its check", "optimal", "infeasible", "residual"
    )
    for name, runs in groups.items():
        s = statistics(runs)
        times = [f"{1e3 * s[key]:.1f} ms" for key in ("median", "mean", "p99", "max", "checking")]
        table.add_row(
            name, str(s["tasks"]), *times, str(s["optimal"]), str(s["infeasible"]), f"{s['residual']:.0e}"
        )
    return table


def gallery_table(gallery: list[Run]) -> Table:
    """One row per task: verdict or objective, and seconds, by method."""
    methods = list(dict.fromkeys(r.method for r in gallery))
    table = Table("gallery task", *(column for m in methods for column in (m, "seconds")), "MIQP1's residual")
    by_name: dict[str, dict[str, Run]] = {}
    for r in gallery:
        by_name.setdefault(r.name, {})[r.method] = r
    for name, runs in by_name.items():
        cells = [
            cell
            for m in methods
            for cell in ((verdict(runs[m]), f"{runs[m].seconds:.3f}") if m in runs else ("", ""))
        ]
        thesis = runs.get("thesis")
        table.add_row(name, *cells, f"{thesis.plan.residual:.1e}" if thesis and thesis.plan.found else "")
    return table


def verdict(r: Run) -> str:
    """Objective, with its bound where the gap stayed open, or the status."""
    if not r.plan.found:
        return r.plan.status
    return f"{r.plan.objective:.5g}" + ("" if r.decided else f" (bound {r.plan.bound:.4g})")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--quick", action="store_true", help="fewer pairs, short limits for SCIP, MIQP1 on primitives alone"
    )
    parser.add_argument("--tasks", type=int, default=200, help="random tasks with 4 to 6 facets per group")
    parser.add_argument("--pairs", type=int, help="small tasks given to both exact methods (90; quick: 8)")
    parser.add_argument("--limit", type=float, help="seconds for each program in SCIP (60; quick: 4)")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    quick = options.quick
    limit = options.limit or (4.0 if quick else 60.0)
    warm_up()
    count = options.tasks
    few, twelve = random_runs(count, (4, 6)), random_runs(max(count // 4, 1), (12, 12))
    gallery = gallery_runs(("exact",) if quick else ("exact", "thesis", "scip"), limit)
    if quick:
        gallery += [run(n, read_problem(GALLERY / f"{n}.yaml").task, "thesis", limit) for n in PRIMITIVES]
    pairs = agreement_runs(options.pairs or (8 if quick else 90), limit)
    bars = judge(few, twelve, gallery, pairs, wanted=5 if quick else 60)
    report(options.json, few | twelve, gallery, pairs, bars)
    return 0 if all(ok for *_, ok in bars.rows) else 1


def report(
    file: Path | None,
    groups: dict[str, list[Run]],
    gallery: list[Run],
    pairs: list[tuple[Run, Run]],
    bars: Bars,
) -> None:
    """Tables on stdout, everything in JSON."""
    console = Console(width=max(Console().width, 140))
    console.print(random_table(groups), gallery_table(gallery))
    table = Table("bar", "measured", "wanted", "")
    for what, measured, wanted, ok in bars.rows:
        table.add_row(what, measured, wanted, "ok" if ok else "MISSED")
    console.print(table)
    for r in [*(r for runs in groups.values() for r in runs), *gallery, *(r for pair in pairs for r in pair)]:
        for fault in r.faults:
            console.print(f"{r.name} ({r.method}): {fault}")
    for pair in pairs:
        if text := contradiction(*pair):
            console.print(text)
    if file:
        sets = {**groups, "gallery": gallery}
        content: dict[str, Any] = {name: [r.as_dict() for r in runs] for name, runs in sets.items()}
        content["agreement"] = [[r.as_dict() for r in pair] for pair in pairs]
        content["statistics"] = {name: statistics(runs) for name, runs in groups.items()}
        content["bars"] = [
            dict(zip(("what", "measured", "wanted", "ok"), row, strict=True)) for row in bars.rows
        ]
        file.write_text(json.dumps(content, indent=1))


if __name__ == "__main__":
    sys.exit(main())
