"""Stages of the structured model side by side, with paired tests; and what calibration gains where the camera is biased.

    python -m tests.benchmarks.stages [--quick] [--tasks 200] [--output runs/large] [--seed 0] [--json FILE]

Fresh tasks, clean videos.  Stages come from the checkpoints that `python train.py experiment=large` leaves (`structured/all` for
NN and NNM, `structured/dlm_biased` for the biased camera); missing ones are named and left out.  No stage tries its plans out.
"""

import argparse
import json
import sys
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import torch
from rich.console import Console
from rich.progress import track
from rich.table import Table

from datasets.render import Frames
from datasets.specification import Sample
from dlm.evaluation.significance import compare_all
from dlm.execution import expert_action, idle_action
from dlm.inverse_dynamics.layer import Action
from dlm.policy import Policy, PolicyKind
from dlm.structured import ExpertPlanner, StructuredModel
from dlm.structured.bias import STATED
from dlm.structured.policies import Perceiver, StructuredArchitecture, unsolved
from dlm.tasks import TaskBatch
from dlm.training.checkpoint import load, restore_weights
from expert.errors import InvalidProblem
from tests.benchmarks.structured import SEED, Record, executed, fresh

Act = Callable[[Sample, Frames], Action]
KINDS: dict[str, PolicyKind] = {"nn": "regressor", "nnm": "regressor", "mdr": "best_guess"}
CHECKED = "MDR, 8 checked"
"""The scorer of MDR with the planner of CVX."""
GUESSED = "CVX, one class"
"""The scorer of CVX with the planner of MDR."""
FITTED = "DLM for this camera"
Pairs = tuple[tuple[str, str], ...]
PAIRS: Pairs = (
    ("NN", "NNM"),
    ("NNM", "MDR"),
    ("MDR", GUESSED),
    ("MDR", CHECKED),
    ("MDR", "CVX"),
    (CHECKED, "CVX"),
    ("CVX", "DLM"),
    ("CVX", "no learning"),
    ("no learning", "expert"),
)
SETS = ("4-6", "12", "biased")
BIASED_PAIRS: Pairs = (("CVX", "DLM"), ("CVX", FITTED))


def policy(folder: Path, stage: str, see: Perceiver, kind: PolicyKind) -> Policy | None:
    """A trained stage, None if there is no such checkpoint."""
    path = folder / f"{stage}.safetensors"
    if not path.is_file():
        print(f"no {path}: left out", file=sys.stderr)
        return None
    fresh_ones = StructuredArchitecture()
    built = fresh_ones.regressor() if kind == "regressor" else fresh_ones.proposer(kind)
    built.base = replace(built.base, perceive=see)
    restore_weights(
        built.weights(),
        load(path, command="python train.py experiment=large"),
        name="structured",
        source=path,
    )
    return built.eval()


def of_policy(one: Policy) -> Act:
    def act(sample: Sample, video: Frames) -> Action:
        with torch.no_grad():
            return one(torch.from_numpy(video)[None])

    return act


def of_model(model: StructuredModel) -> Act:
    def act(sample: Sample, video: Frames) -> Action:
        try:
            return model.act(video).action()
        except InvalidProblem:
            return unsolved(len(video), 2)

    return act


def run(
    rows: dict[str, Act], samples: list[Sample], videos: list[Frames], title: str
) -> dict[str, list[Record]]:
    console = Console(stderr=True)
    return {
        name: [
            executed(act(s, v), s)
            for s, v in track(
                list(zip(samples, videos, strict=True)),
                f"{title}: {name}",
                console=console,
                disable=not console.is_terminal,
            )
        ]
        for name, act in rows.items()
    }


def losses(records: list[Record]) -> np.ndarray:
    return np.array([r["loss"] for r in records], dtype=float)


def learned(folder: Path, see: Perceiver) -> dict[str, Act]:
    """Rows of the stages that are there, in order; the one for the biased camera comes last."""
    plan: list[tuple[str, str, PolicyKind]] = [
        (stage.upper(), stage, KINDS.get(stage, "proposals")) for stage in ("nn", "nnm", "mdr", "cvx", "dlm")
    ]
    plan += [
        (CHECKED, "mdr", "proposals"),
        (GUESSED, "cvx", "best_guess"),
        (FITTED, "dlm_biased", "proposals"),
    ]
    found = ((title, policy(folder, stage, see, kind)) for title, stage, kind in plan)
    return {title: of_policy(one) for title, one in found if one is not None}


def rows_of(folder: Path, see: Perceiver) -> tuple[dict[str, Act], dict[str, Act]]:
    """What is compared where the camera is as stated, and where it is biased."""
    rows: dict[str, Act] = {"no action": lambda s, v: idle_action(TaskBatch.of([s]))}
    rows |= learned(folder, see)
    biased = {name: rows[name] for name in ("no action", "CVX", "DLM", FITTED) if name in rows}
    rows.pop(FITTED, None)
    rows |= {
        "no learning": of_model(StructuredModel(perceive=see)),
        "expert": of_model(StructuredModel(planner=ExpertPlanner(), perceive=see)),
        "oracle": lambda s, v: expert_action(TaskBatch.of([s])),
    }
    return rows, biased


def measured(options: argparse.Namespace) -> dict[str, dict[str, list[Record]]]:
    """Records by set and row."""
    see, camera = Perceiver(), StructuredModel().camera
    rows, biased = rows_of(options.output / f"seed_{options.seed}", see)
    results: dict[str, dict[str, list[Record]]] = {}
    for name in options.sets:
        count = 20 if options.quick else options.tasks
        samples = fresh("4-6" if name == "biased" else name, count, SEED + 2, options.folder)
        if name == "biased":
            videos = [STATED.video(s.task.body, s.task.trajectory.poses, camera) for s in samples]
            results["4-6 facets, biased camera"] = run(biased, samples, videos, name)
        else:
            results[f"{name} facets"] = run(rows, samples, [s.video for s in samples], name)
    return results


def figures(records: list[Record], idle: float) -> dict[str, object]:
    """What the table shows of one row; idle: mean loss of no action."""
    loss = losses(records)
    return {
        "mean": float(loss.mean()),
        "ratio": float(loss.mean() / idle),
        "median": float(np.median(loss)),
        "within": float(np.mean([bool(r["within"]) for r in records])),
        "dropped": sum(bool(r["dropped"]) for r in records),
        "losses": loss.tolist(),
    }


def shown(title: str, found: dict[str, list[Record]], pairs: Pairs) -> dict[str, object]:
    """Print the table and the tests of one set; the same as plain values."""
    table = Table("", "mean", "median", "within", "dropped", title=title)
    idle = float(losses(found["no action"]).mean())
    report: dict[str, object] = {}
    for name, records in found.items():
        row = report[name] = figures(records, idle)
        cells = (f"{row['mean']:.4g}", f"{row['median']:.2g}", f"{row['within']:.3f}", str(row["dropped"]))
        table.add_row(name, *cells)
    Console(width=110).print(table)
    known = [pair for pair in pairs if set(pair) <= set(found)]
    series = {name: {title: losses(records)} for name, records in found.items()}
    compared = compare_all(series, known, rng=np.random.default_rng(0))
    for c in compared:
        print(
            f"{c.first} -> {c.second}: {c.difference:+.4g} [{c.low:+.4g}, {c.high:+.4g}] cm^2, "
            f"p of the mean {c.p_mean:.3g}, of ranks {c.p_ranks:.3g}: {c.verdict}"
        )
    return report | {"tests": [asdict(c) for c in compared]}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="20 tasks")
    parser.add_argument("--tasks", type=int, default=200)
    parser.add_argument("--output", type=Path, default=Path("runs/large"))
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--folder", type=Path, default=Path("data"))
    parser.add_argument("--sets", nargs="+", choices=SETS, default=list(SETS))
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    torch.set_num_threads(1)
    results = measured(options)
    report = {
        title: shown(title, found, BIASED_PAIRS if "biased" in title else PAIRS)
        for title, found in results.items()
    }
    if options.json:
        options.json.write_text(json.dumps(report, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
