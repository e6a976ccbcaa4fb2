"""The structured model on fresh tasks: how well do its plans move the object, from clean and from noisy videos, and how fast?

    python -m tests.benchmarks.structured [--quick] [--tasks 500] [--models shipped ...] [--json FILE] [--records FILE]

Objects of 4 to 6 and of 12 facets, 500 tasks each, of seeds that nothing was tuned on (margins and widths were chosen on
dataset=validation and validation_12).  Object-trajectory loss [cm^2] and share of tasks that end within 2 mm and 2 deg, in the
simulator with rigid contact; every task that does not is listed with its cause.  Times are processor time of one core.
With --records the tasks done so far are kept in a file, and the same command goes on from there.
"""

import argparse
import json
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import shapely
import torch
from rich.console import Console
from rich.progress import track
from rich.table import Table

from datasets.disturb import DISTURBANCES
from datasets.generation import Generation, generate
from datasets.render import Frames
from datasets.shapes import ShapeFamily, Shapes
from datasets.shapes_omnipush import OmniPush
from datasets.specification import Sample, Specification
from datasets.store import read_dataset
from dlm.evaluation.outcomes import FALLEN
from dlm.execution import expert_action, given_action, idle_action, idle_where_unsolved, simulate
from dlm.inverse_dynamics.layer import Action
from dlm.metrics import object_trajectory_loss, rotation_error, translation_error, within
from dlm.simulator import SimulatorSettings
from dlm.structured import ExpertPlanner, Planned, StructuredModel
from dlm.structured.policies import unsolved
from dlm.structured.weights import shipped
from dlm.tasks import TaskBatch
from expert.errors import InvalidProblem
from expert.geometry.pose import to_body, to_world
from expert.mechanics import external_contacts
from expert.problems.contact import FREE, ContactTask, Plan

KINDS: dict[str, ShapeFamily] = {
    "4-6": Shapes(),
    "12": Shapes(facets=(12, 12)),
    "omnipush": OmniPush(diameter=(0.07, 0.10)),
}
"""Omnipush: shapes unlike those in training, most of them not convex; reported, without a bar."""
SEED = 202
BARS = {
    ("4-6", "clean"): (0.005, 0.97),
    ("12", "clean"): (0.02, 0.95),
    ("4-6", "noise 3"): (0.02, 0.95),
    ("12", "noise 3"): (0.05, 0.90),
    ("4-6", "noise 5"): (0.03, 0.92),
    ("12", "noise 5"): (0.15, 0.70),
}
"""Largest mean loss [cm^2] and least share within 2 mm and 2 deg, of the shipped model."""
MEDIAN_BAR = 1e-3
"""Largest median loss when clean."""
MOST_SECONDS = 0.110
"""Median of one video."""
MODELS: dict[str, Callable[[], StructuredModel]] = {
    "shipped": shipped,
    "without trials": lambda: shipped(robust=False),
    "best guess": lambda: shipped(best_guess=True, robust=False),
    "no learning": StructuredModel,
    "expert on perceived geometry": lambda: StructuredModel(planner=ExpertPlanner()),
}
FIXED: dict[str, Callable[[TaskBatch], Action]] = {"no action": idle_action, "oracle": expert_action}
LARGE_TURN, LARGE_DEVIATION = 1.0, 1.0
"""Errors of perception that count as a cause [deg, mm]."""

Record = dict[str, object]


def fresh(kind: str, count: int, seed: int, folder: Path) -> list[Sample]:
    """Labelled tasks; made once and kept."""
    name = "fresh_" + kind.replace("-", "_")
    specification = Specification(name=name, count=count, shard=20, shapes=KINDS[kind])
    out = folder / f"{name}-seed{seed}-{count}"
    generate(Generation(specification=specification, seed=seed, out=out, jobs=1))
    data = read_dataset(out)
    return [data[i] for i in range(len(data))]


@dataclass
class Records:
    """Results by task, kept in a file of one JSON text per line."""

    path: Path | None
    known: dict[tuple, Record] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.path is not None and self.path.exists():
            for line in self.path.read_text().splitlines():
                record = json.loads(line)
                self.known[self.key(record)] = record

    @staticmethod
    def key(record: Record) -> tuple:
        return tuple(record[name] for name in ("model", "kind", "disturbance", "seed", "index"))

    def add(self, record: Record) -> None:
        self.known[self.key(record)] = record
        if self.path is not None:
            with self.path.open("a") as file:
                file.write(json.dumps(record) + "\n")


def seen(sample: Sample, disturbance: str) -> Frames:
    """Its video, disturbed; the same for all models."""
    return DISTURBANCES[disturbance](sample.video, np.random.default_rng([sample.index, 17]))


def measure(model: StructuredModel, sample: Sample, video: Frames) -> Record:
    """One video through the model and the simulator."""
    start = time.process_time()
    try:
        planned, reason = model.act(video), ""
    except InvalidProblem as error:
        planned, reason = None, str(error)
    seconds = time.process_time() - start
    action = unsolved(len(video), 2) if planned is None else planned.action()
    return {
        **executed(action, sample),
        "status": "refused" if planned is None else planned.status,
        "reason": reason if planned is None else planned.reason,
        "checked": 0 if planned is None else planned.checked,
        "seconds": seconds,
        "cause": cause(planned, sample),
    }


def executed(action: Action, sample: Sample) -> Record:
    """What the action does to the true object."""
    tasks = TaskBatch.of([sample])
    poses = simulate(idle_where_unsolved(action, tasks), tasks, SimulatorSettings()).numpy()[0]
    desired = sample.task.trajectory.poses
    return {
        "family": sample.family,
        "loss": float(object_trajectory_loss(poses, desired)),
        "within": bool(within(poses, desired)),
        "dropped": bool((desired - poses)[-1, 1] > FALLEN),
        "mm": float(translation_error(poses, desired)[-1]),
        "deg": float(rotation_error(poses, desired)[-1]),
    }


def cause(planned: Planned | None, sample: Sample) -> str:
    """What is amiss with a plan, the first thing that is; read only where the execution failed."""
    if planned is None or planned.plan is None or planned.task is None:
        return "no plan"
    seen, true = planned.perceived, sample.task
    turn = np.degrees(np.abs(seen.poses - true.trajectory.poses)[:, 2].max())
    shapes = [shapely.Polygon(v).exterior for v in (true.body.vertices, seen.vertices)]
    deviation = 1e3 * float(shapes[0].hausdorff_distance(shapes[1]))
    if contacts_of(planned.task) != contacts_of(true):
        return "contacts with the floor misread"
    if turn > LARGE_TURN or deviation > LARGE_DEVIATION:
        return f"geometry misread ({turn:.1f} deg, outline {deviation:.1f} mm)"
    oracle = executed(expert_action(TaskBatch.of([sample])), sample)
    if not oracle["within"]:
        return "the expert's own plan fails in execution"
    moved, distance = meeting(planned.plan, true)
    if executed(moved, sample)["within"]:
        return f"a finger meets the outline {distance:.2f} mm too early or too late, which its spring makes much of"
    return f"execution, with geometry right ({turn:.2f} deg, outline {deviation:.2f} mm)"


def meeting(plan: Plan, task: ContactTask) -> tuple[Action, float]:
    """The plan with its touching fingers moved onto the true outline, and how far at most [mm]."""
    outline = shapely.Polygon(task.body.vertices).exterior
    planned = to_body(task.trajectory.poses, plan.positions)
    along = shapely.line_locate_point(outline, shapely.points(planned))
    nearest = shapely.get_coordinates(shapely.line_interpolate_point(outline, along)).reshape(planned.shape)
    body = np.where(plan.modes[..., None] == FREE, planned, nearest)
    positions = torch.from_numpy(to_world(task.trajectory.poses, body))[None]
    return given_action(positions, torch.from_numpy(np.array(plan.forces))[None]), 1e3 * float(
        np.linalg.norm(body - planned, axis=-1).max()
    )


def contacts_of(task: ContactTask) -> list[tuple]:
    """Step, and the directions that each floor contact can push in."""
    return [(c.step, *np.sign(np.round(c.rays[:, 0], 9))) for c in external_contacts(task)]


def summary(records: list[Record]) -> dict[str, object]:
    """Of one row."""
    loss = np.array([r["loss"] for r in records], dtype=float)
    missed = [r for r in records if not r["within"]]
    return {
        "tasks": len(records),
        "mean": float(loss.mean()),
        "median": float(np.median(loss)),
        "within": float(np.mean([bool(r["within"]) for r in records])),
        "dropped": sum(bool(r["dropped"]) for r in records),
        "no plan": sum(r["status"] in ("no_plan", "refused") for r in records),
        "poor fit": sum(r["status"] == "poor_fit" for r in records),
        "risky": sum(r["status"] == "risky" for r in records),
        "milliseconds": 1e3 * float(np.median([float(str(r["seconds"])) for r in records])),
        "p95": 1e3 * float(np.quantile([float(str(r["seconds"])) for r in records], 0.95)),
        "missed": [
            {
                k: r[k]
                for k in ("index", "family", "loss", "mm", "deg", "dropped", "status", "cause", "reason")
            }
            for r in missed
        ],
    }


def rows_of(
    options: argparse.Namespace, samples: dict[str, list[Sample]], records: Records, console: Console
) -> Iterator[tuple[str, str, str, list[Record]]]:
    """Model, kind, disturbance and its records."""
    for name in options.models:
        model = None if name in FIXED else MODELS[name]()
        for kind, tasks in samples.items():
            for disturbance in ["clean"] if name in FIXED else options.disturbances:
                found = []
                title = f"{name}, {kind}, {disturbance}"
                for sample in track(tasks, title, console=console, disable=not console.is_terminal):
                    about = {"model": name, "kind": kind, "disturbance": disturbance}
                    about |= {"seed": options.seed, "index": sample.index}
                    if (key := Records.key(about)) not in records.known:
                        records.add({**about, **_result(name, model, sample, disturbance)})
                    found.append(records.known[key])
                yield name, kind, disturbance, found


def _result(name: str, model: StructuredModel | None, sample: Sample, disturbance: str) -> Record:
    if model is not None:
        return measure(model, sample, seen(sample, disturbance))
    own = executed(FIXED[name](TaskBatch.of([sample])), sample)
    return {**own, "status": "planned", "reason": "", "checked": 0, "seconds": 0.0, "cause": ""}


def missed(row: dict) -> list[str]:
    """Bars that a row of the shipped model does not meet, in words."""
    name, found = f"{row['kind']}, {row['disturbance']}", []
    if row["model"] != "shipped" or (row["kind"], row["disturbance"]) not in BARS:
        return found
    most, least = BARS[row["kind"], row["disturbance"]]
    if row["mean"] > most:
        found.append(f"{name}: mean loss {row['mean']:.4f} > {most}")
    if row["within"] < least:
        found.append(f"{name}: within {row['within']:.3f} < {least}")
    if row["disturbance"] == "clean" and row["median"] > MEDIAN_BAR:
        found.append(f"{name}: median {row['median']:.5f} > {MEDIAN_BAR}")
    if row["milliseconds"] > 1e3 * MOST_SECONDS:  # though the bar is meant without trials
        found.append(f"{name}: {row['milliseconds']:.0f} ms > {1e3 * MOST_SECONDS:.0f} ms")
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="25 tasks per row")
    parser.add_argument("--tasks", type=int, default=500)
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--models", nargs="+", default=["shipped"], choices=[*MODELS, *FIXED])
    parser.add_argument("--disturbances", nargs="+", default=["clean", "noise 3", "noise 5"])
    parser.add_argument("--kinds", nargs="+", default=["4-6", "12"], choices=list(KINDS))
    parser.add_argument("--folder", type=Path, default=Path("data"), help="where the fresh tasks are kept")
    parser.add_argument("--records", type=Path)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    torch.set_num_threads(1)
    console = Console(stderr=True)
    count = 25 if options.quick else options.tasks
    samples = {kind: fresh(kind, count, options.seed, options.folder) for kind in options.kinds}
    StructuredModel().act(next(iter(samples.values()))[0].video)  # compiles
    rows = [
        {"model": name, "kind": kind, "disturbance": disturbance, **summary(found)}
        for name, kind, disturbance, found in rows_of(options, samples, Records(options.records), console)
    ]
    columns = (
        "tasks",
        "mean",
        "median",
        "within",
        "dropped",
        "no plan",
        "poor fit",
        "risky",
        "milliseconds",
        "p95",
    )
    table = Table("model", "facets", "video", *columns)
    for row in rows:
        numbers = [f"{row[c]:.3g}" if isinstance(row[c], float) else str(row[c]) for c in columns]
        table.add_row(row["model"], row["kind"], row["disturbance"], *numbers)
    Console(width=150).print(table)
    for row in rows:
        for one in row["missed"] if row["model"] in MODELS else []:
            print(
                f"{row['model']}, {row['kind']}, {row['disturbance']}, task {one['index']} ({one['family']}): loss "
                f"{one['loss']:.3g}, {one['mm']:.1f} mm, {one['deg']:.1f} deg, {one['status']}; {one['cause']}"
                + (f"; {one['reason']}" if one["reason"] else "")
            )
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1))
    misses = [line for row in rows for line in missed(row)]
    print("\n".join(misses) or "all bars met")
    return 1 if misses else 0


if __name__ == "__main__":
    sys.exit(main())
