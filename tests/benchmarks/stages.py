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
from dlm.checkpoint import load, restore_weights
from dlm.evaluation.significance import compare_all
from dlm.execution import expert_action, idle_action
from dlm.inverse_dynamics import Action
from dlm.models import Policy
from dlm.structured import ExpertPlanner, StructuredModel
from dlm.structured.bias import STATED
from dlm.structured.policies import (
    Perceiver,
    ProposalPolicy,
    RegressorPolicy,
    StructuredArchitecture,
    unsolved,
)
from dlm.tasks import TaskBatch
from expert.errors import InvalidProblem
from tests.benchmarks.structured import SEED, Record, executed, fresh

Act = Callable[[Sample, Frames], Action]
KINDS = {"nn": "regressor", "nnm": "regressor", "mdr": "best_guess"}
CHECKED = "MDR, 8 checked"
"""The scorer of MDR with the planner of CVX."""
GUESSED = "CVX, one class"
"""The scorer of CVX with the planner of MDR."""
PAIRS = (
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
BIASED_PAIRS = (("CVX", "DLM"), ("CVX", "DLM for this camera"))


def policy(folder: Path, stage: str, see: Perceiver, kind: str = "") -> Policy | None:
    """A trained stage, None if there is no such checkpoint."""
    path = folder / f"{stage}.safetensors"
    if not path.is_file():
        print(f"no {path}: left out", file=sys.stderr)
        return None
    built = StructuredArchitecture().build(kind or KINDS.get(stage, "proposals"))  # type: ignore[arg-type]
    assert isinstance(built, ProposalPolicy | RegressorPolicy)
    built.base = _seeing(built.base, see)
    restore_weights(
        built.weights(),
        load(path, command="python train.py experiment=large"),
        name="structured",
        source=path,
    )
    return built.eval()


def _seeing(model: StructuredModel, see: Perceiver) -> StructuredModel:
    return replace(model, perceive=see)


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
    count = 20 if options.quick else options.tasks
    see = Perceiver()
    folder = options.output / f"seed_{options.seed}"
    trained = {s: policy(folder, s, see) for s in ("nn", "nnm", "mdr", "cvx", "dlm", "dlm_biased")}
    for title, stage, kind in ((CHECKED, "mdr", "proposals"), (GUESSED, "cvx", "best_guess")):
        if (one := policy(folder, stage, see, kind)) is not None:
            trained[title] = one
    plain = StructuredModel(perceive=see)
    rows: dict[str, Act] = {"no action": lambda s, v: idle_action(TaskBatch.of([s]))}
    rows |= {
        s if s in (CHECKED, GUESSED) else s.upper(): of_policy(p)
        for s, p in trained.items()
        if p is not None and s != "dlm_biased"
    }
    rows |= {
        "no learning": of_model(plain),
        "expert": of_model(StructuredModel(planner=ExpertPlanner(), perceive=see)),
        "oracle": lambda s, v: expert_action(TaskBatch.of([s])),
    }
    biased = {n: rows[n] for n in ("no action", "CVX", "DLM") if n in rows}
    if (one := trained["dlm_biased"]) is not None:
        biased["DLM for this camera"] = of_policy(one)
    results: dict[str, dict[str, list[Record]]] = {}
    for name in options.sets:
        samples = fresh("4-6" if name == "biased" else name, count, SEED + 2, options.folder)
        if name == "biased":
            videos = [STATED.video(s.task.body, s.task.trajectory.poses, plain.camera) for s in samples]
            results["4-6 facets, biased camera"] = run(biased, samples, videos, name)
        else:
            results[f"{name} facets"] = run(rows, samples, [s.video for s in samples], name)
    report = {}
    for title, found in results.items():
        table = Table("", "mean", "median", "within", "dropped", title=title)
        idle = losses(found["no action"]).mean()
        report[title] = {}
        for name, records in found.items():
            loss, within = losses(records), float(np.mean([bool(r["within"]) for r in records]))
            dropped = sum(bool(r["dropped"]) for r in records)
            table.add_row(name, f"{loss.mean():.4g}", f"{np.median(loss):.2g}", f"{within:.3f}", str(dropped))
            report[title][name] = {
                "mean": float(loss.mean()),
                "ratio": float(loss.mean() / idle),
                "median": float(np.median(loss)),
                "within": within,
                "dropped": dropped,
                "losses": loss.tolist(),
            }
        Console(width=110).print(table)
        pairs = [p for p in (BIASED_PAIRS if "biased" in title else PAIRS) if set(p) <= set(found)]
        compared = compare_all(
            {n: {title: losses(r)} for n, r in found.items()}, pairs, rng=np.random.default_rng(0)
        )
        for c in compared:
            print(
                f"{c.first} -> {c.second}: {c.difference:+.4g} [{c.low:+.4g}, {c.high:+.4g}] cm^2, p of the mean {c.p_mean:.3g}, "
                f"of ranks {c.p_ranks:.3g}: {c.verdict}"
            )
        report[title]["tests"] = [asdict(c) for c in compared]
    if options.json:
        options.json.write_text(json.dumps(report, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
