"""What more tasks are worth: the thesis's networks and the structured model, trained on the first 20, 200, ... tasks of one set.

    python -m tests.benchmarks.data_size [--quick] [--sizes 20 200 2000 10000] [--models thesis structured] [--batch-norm settled]

Every size takes equally many steps of Adam, in batches of 20 tasks: only the data differ.  Losses are those of Table 4.1, on its test
set (12 facets) and its family set, in the simulator with rigid contact.  Training is left to train.py; stopped, it goes on.
Settled: the statistics of batch norm are taken anew after training, over (up to 2,000 of) the tasks that were trained on.
"""

import argparse
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import torch
from rich.console import Console
from rich.table import Table

from dlm.evaluation.outcomes import Outcome, act, execute
from dlm.evaluation.settle import ENOUGH, settle
from dlm.evaluation.trained import read_trained
from dlm.execution import idle_action
from dlm.policy import Policy
from dlm.simulator import SimulatorSettings
from dlm.structured.policies import ProposalPolicy
from dlm.tasks import TaskBatch
from dlm.training.checkpoint import read_about
from evaluate import build

ROOT = Path(__file__).resolve().parents[2]
BATCH, STEPS = 20, 1000
STAGES = {"thesis": ("nn", "mdr", "cvx"), "structured": ("mdr",)}
"""Stages that learn from labels.  CVX starts from MDR, takes half as many steps, and smaller ones."""
SETS = {"test": "data/test-seed0", "family": "data/family-seed0"}
QUICK = {"test": "data/smoke-seed0"}
TITLES = {("structured", "mdr"): "structured, one class", ("structured", "8"): "structured, 8 checked"}

Row = dict[str, object]


def iterations_of(stage: str, size: int, options: argparse.Namespace) -> int:
    """Passes over so many tasks."""
    steps = options.steps // 2 if stage == "cvx" else options.steps
    return max(1, steps * min(BATCH, size) // size)


def train(model: str, stage: str, size: int, options: argparse.Namespace) -> None:
    """One stage, unless that is done."""
    path = folder(model, size, options) / "seed_0" / f"{stage}.safetensors"
    if not path.exists() or read_about(path, command="").iteration < iterations_of(stage, size, options):
        subprocess.run([sys.executable, *command(model, stage, size, options)], check=True, cwd=ROOT)


def command(model: str, stage: str, size: int, options: argparse.Namespace) -> list[str]:
    """What trains one stage on the first `size` tasks."""
    batch = min(BATCH, size)
    iterations = iterations_of(stage, size, options)
    schedule = {"batch_size": batch, "learning_rate": 1e-3, "log_every": iterations}
    schedule |= {"iterations": iterations, "save_every": -(-iterations // 4)}
    own = {"iterations": iterations, "learning_rate": 3e-4}
    return [
        "train.py",
        f"model={model}",
        f"stage={'structured/' if model == 'structured' else ''}{stage}",
        f"data={options.data}",
        "solver=batched",
        f"train_tasks={size}",
        f"output={folder(model, size, options)}",
        "resume=true",
        *(f"schedule.{name}={value}" for name, value in schedule.items()),
        *(f"+stages.cvx.schedule.{name}={value}" for name, value in own.items() if stage == "cvx"),
    ]


def folder(model: str, size: int, options: argparse.Namespace) -> Path:
    """Where its checkpoints are."""
    return options.output / f"{model}_{size}"


def policies(model: str, size: int, options: argparse.Namespace) -> dict[str, Policy]:
    """The trained stages by their titles in the table; the structured scorer also with eight of its proposals checked."""
    found: dict[str, Policy] = {}
    seen = None
    if model == "thesis" and options.batch_norm == "settled":
        seen = TaskBatch.read(options.train, min(size, ENOUGH))
    for stage in STAGES[model]:
        policy = read_trained(folder(model, size, options), stage, [0], build).policies[0]
        if seen is not None:
            settle(policy, seen)
        found[TITLES.get((model, stage), stage.upper())] = policy
        if isinstance(policy, ProposalPolicy):
            many = ProposalPolicy(policy.scorer, policy.base, (8,), widen=False)
            found[TITLES[model, "8"]] = many
    return found


def figures(outcome: Outcome, idle: float) -> Row:
    """What tables show."""
    loss = outcome.object_loss
    return {
        "mean": float(loss.mean()),
        "over no action": float(loss.mean()) / idle,
        "median": float(np.median(loss)),
        "within": float(outcome.success.mean()),
        "fingers": float(outcome.finger_loss.mean()),
        "dropped": int(outcome.dropped.sum()),
    }


def measured(options: argparse.Namespace) -> list[Row]:
    """A row per model, stage, size and set."""
    sets = {name: TaskBatch.read(path) for name, path in (QUICK if options.quick else SETS).items()}
    simulator, rows = SimulatorSettings(), []
    idle = {n: execute(idle_action(b), b, simulator).object_loss.mean() for n, b in sets.items()}
    for model in options.models:
        for size in options.sizes:
            for title, policy in policies(model, size, options).items():
                for name, batch in sets.items():
                    outcome = execute(act(policy, batch), batch, simulator)
                    row = {"model": title, "tasks": size, "set": name}
                    rows.append({**row, **figures(outcome, idle[name])})
    return rows


def write_extras(rows: list[Row], target: Path) -> None:
    """Charts as `dlm.evaluation.extras` reads them."""
    target.mkdir(parents=True, exist_ok=True)
    for name in dict.fromkeys(str(r["set"]) for r in rows):
        series: dict[str, list] = {}
        for row in rows:
            if row["set"] == name:
                series.setdefault(str(row["model"]), []).append([row["tasks"], row["over no action"]])
        chart = {
            "title": f"Data size, {name} set",
            "caption": "Mean object-trajectory loss over that of no action, by number of training tasks; equally many steps each.",
            "command": "python -m tests.benchmarks.data_size",
            "x": "training tasks",
            "y": "loss / no action",
            "series": series,
        }
        (target / f"data_size_{name}.json").write_text(json.dumps(chart, indent=1))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="the smoke data set, four steps")
    parser.add_argument("--sizes", type=int, nargs="+", default=[20, 200, 2000, 10000])
    parser.add_argument("--models", nargs="+", choices=list(STAGES), default=list(STAGES))
    parser.add_argument("--steps", type=int, default=STEPS)
    parser.add_argument("--data", default="large", help="configuration of the data sets")
    parser.add_argument("--train", default="data/large-seed0", help="their training set")
    parser.add_argument("--batch-norm", choices=["running", "settled"], default="running")
    parser.add_argument("--output", type=Path, default=Path("runs/data_size"))
    parser.add_argument("--json", type=Path)
    parser.add_argument(
        "--extras", type=Path, help="folder for charts that `evaluate.py extras=[...]` can show"
    )
    options = parser.parse_args()
    if options.quick:
        options.sizes, options.steps, options.data, options.train = [4], 4, "smoke", QUICK["test"]
        options.output = options.output / "quick"
    torch.set_num_threads(1)
    for model in options.models:
        for size in options.sizes:
            for stage in STAGES[model]:
                train(model, stage, size, options)
    rows = measured(options)
    table = Table(*rows[0])
    for row in rows:
        table.add_row(*(f"{v:.3g}" if isinstance(v, float) else str(v) for v in row.values()))
    Console(width=120).print(table)
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1))
    if options.extras:
        write_extras(rows, options.extras)
    return 0


if __name__ == "__main__":
    sys.exit(main())
