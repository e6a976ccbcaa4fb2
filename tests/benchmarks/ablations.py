"""What each ingredient of learning is worth, one change at a time.

    python -m tests.benchmarks.ablations [--quick] [--only margin] [--tasks 100] [--data data/large-seed0] [--json FILE]

margin      facet margin of planning, videos of objects with 12 facets, noise 3/255
top-k       number of proposals that are checked, without a second chance
torque      4-CT6 with the torque to first order, and as printed, at the perceived parameters
gradient    kind of gradient and kappa: Adam on the expert's actions, displaced, through the simulator
splitting   training the scorer with and without split facets
data        training the scorer on the first 20, 200, ... tasks of --data

The last two train, with equal numbers of steps.  Tasks are fresh; nothing was chosen on them.  Shares are of tasks that end within
2 mm and 2 deg.
"""

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from rich.console import Console
from rich.table import Table

from datasets.specification import Sample
from datasets.store import read_dataset
from dlm.evaluation.outcomes import Outcome, execute
from dlm.execution import given_action, idle_where_unsolved, simulate
from dlm.inverse_dynamics.layer import Action, InverseDynamics
from dlm.inverse_dynamics.parameters import ParameterBatch
from dlm.metrics import object_trajectory_loss
from dlm.simulator import SimulatorSettings
from dlm.structured import ClassPlanner, Planned, StructuredModel
from dlm.structured.examples import Example
from dlm.structured.losses import class_distance
from dlm.structured.planning import Planning
from dlm.structured.policies import Perceiver, StructuredArchitecture, joined, unsolved
from dlm.structured.scorer import Scorer
from dlm.structured.weights import SHIPPED, shipped
from dlm.tasks import TaskBatch
from dlm.training.checkpoint import load, restore_weights
from expert.errors import InvalidProblem
from tests.benchmarks.structured import SEED, fresh, seen

RIGID = SimulatorSettings()
STEPS, BATCH, RATE = 1500, 32, 1e-3
"""Training of a scorer."""
Row = dict[str, object]


def answers(model: StructuredModel, samples: Sequence[Sample], disturbance: str) -> list[Planned | None]:
    """What the model plans for each video; None for refused ones."""
    found: list[Planned | None] = []
    for sample in samples:
        video = seen(sample, disturbance)
        try:
            found.append(model.act(video))
        except InvalidProblem:
            found.append(None)
    return found


def outcome(actions: Sequence[Action], tasks: TaskBatch) -> Outcome:
    """Executed, with idle fingers where there is no action."""
    return execute(idle_where_unsolved(joined(list(actions)), tasks), tasks, RIGID)


def figures(actions: Sequence[Action], tasks: TaskBatch) -> Row:
    """What tables show."""
    result = outcome(actions, tasks)
    loss = result.object_loss
    return {
        "mean": float(loss.mean()),
        "median": float(np.median(loss)),
        "within": float(result.success.mean()),
        "no plan": int((~result.solved).sum()),
    }


def actions_of(planned: Sequence[Planned | None]) -> list[Action]:
    return [unsolved(5, 2) if p is None else p.action() for p in planned]


def margin(samples: dict[str, list[Sample]], options: argparse.Namespace) -> list[Row]:
    """Facet margins, each with the fallbacks below it."""
    see, rows = Perceiver(), []
    tasks = TaskBatch.of(samples["12"])
    for value in (0.0, 0.05, 0.1, 0.2, 0.3):
        planning = Planning(tasks=replace(Planning().tasks, facet_margin=value))
        model = StructuredModel(planning=planning, perceive=see)
        planned = answers(model, samples["12"], "noise 3")
        rows.append({"facet margin": value, **figures(actions_of(planned), tasks)})
    return rows


def top_k(samples: dict[str, list[Sample]], options: argparse.Namespace) -> list[Row]:
    """Shipped scorer; clean videos."""
    see, rows = Perceiver(), []
    for kind, some in samples.items():
        tasks = TaskBatch.of(some)
        for k in (1, 2, 4, 8, 16, 10**6):
            proposing = shipped().planner
            assert isinstance(proposing, ClassPlanner)
            propose = proposing.propose
            assert propose is not None
            first = lambda task, k=k, propose=propose: [np.concatenate(propose(task))[:k]]  # noqa: E731
            planner = replace(proposing, propose=first)
            planned = answers(StructuredModel(planner=planner, perceive=see), some, "clean")
            title = "all" if k == 10**6 else str(k)
            rows.append({"facets": kind, "checked": title, **figures(actions_of(planned), tasks)})
    return rows


def torque(samples: dict[str, list[Sample]], options: argparse.Namespace) -> list[Row]:
    """The program at the parameters of the plan, clean videos of objects with 4 to 6 facets."""
    some = samples["4-6"]
    planned = answers(StructuredModel(perceive=Perceiver()), some, "clean")
    kept = [(p, s) for p, s in zip(planned, some, strict=True) if p is not None and p.parameters is not None]
    tasks = TaskBatch.of([s for _, s in kept])
    batch = ParameterBatch.stack([p.parameters for p, _ in kept if p.parameters is not None])
    rows = []
    for form in ("first_order", "thesis"):
        for slack in (None, 300.0):
            action = InverseDynamics(torque=form, backend="batched", slack=slack)(batch)
            rows.append({"torque": form, "slack q": slack or "eps = 0", **figures([action], tasks)})
    return rows


def gradient(samples: dict[str, list[Sample]], options: argparse.Namespace) -> list[Row]:
    """Adam (30 steps) on displaced finger positions and forces; the smoothed simulator teaches, the rigid one judges."""
    tasks = TaskBatch.of(samples["4-6"][:40])
    noise = torch.Generator().manual_seed(0)
    shift = 1e-3 * torch.randn(tasks.positions.shape, generator=noise, dtype=torch.float64)
    scale = 1 + 0.2 * torch.randn(tasks.forces.shape, generator=noise, dtype=torch.float64)
    rows: list[Row] = [{"gradient": "none", "kappa": "", **figures([_given(tasks, shift, scale)], tasks)}]
    for kind in ("finite_difference", "implicit"):
        for kappa in (100.0, 500.0, 1250.0, np.inf):
            teacher = SimulatorSettings(kappa=kappa, gradient=kind)
            action = _descended(tasks, shift, scale, teacher)
            rows.append({"gradient": kind, "kappa": kappa, **figures([action], tasks)})
    return rows


def _given(tasks: TaskBatch, shift: torch.Tensor, scale: torch.Tensor) -> Action:
    return given_action(tasks.positions + shift, tasks.forces * scale)


def _descended(
    tasks: TaskBatch, shift: torch.Tensor, scale: torch.Tensor, teacher: SimulatorSettings
) -> Action:
    moves, pushes = (torch.zeros_like(shift).requires_grad_() for _ in range(2))
    optimiser = torch.optim.Adam([moves, pushes], lr=0.1)
    for _ in range(30):
        optimiser.zero_grad()
        action = _given(tasks, shift + 1e-3 * moves, scale + 0.2 * pushes)
        object_trajectory_loss(simulate(action, tasks, teacher), tasks.poses).mean().backward()
        optimiser.step()
    with torch.no_grad():
        return _given(tasks, shift + 1e-3 * moves, scale + 0.2 * pushes)


def trained(examples: Sequence[Example], *, splitting: bool, steps: int) -> Scorer:
    """A fresh scorer after so many steps of Adam, the rate falling to zero."""
    rng = np.random.default_rng(0)
    scorer = StructuredArchitecture().proposer().scorer
    optimiser = torch.optim.Adam(scorer.parameters(), lr=RATE)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps)
    for _ in range(steps):
        chosen = rng.choice(len(examples), min(BATCH, len(examples)), replace=False)
        loss = class_distance(scorer, [examples[i].varied(rng, splitting=splitting) for i in chosen])
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        schedule.step()
    return scorer


def ranks(scorer: Scorer, samples: Sequence[Sample]) -> dict[str, float]:
    """Where the expert's class stands in the scorer's order, at true geometry, and whether checking the first ones gives a plan."""
    places, plans = [], []
    for sample in samples:
        task = sample.task
        ranked = scorer.rank(task.body.vertices, task.trajectory.poses)
        own = scorer.schedules.class_of(sample.plan.modes)
        places.append(np.inf if own is None else float((ranked == own).all(axis=1).argmax()))
        planner = ClassPlanner(schedules=scorer.schedules, propose=lambda _, ranked=ranked: [ranked[:8]])
        plan = planner(task).plan
        best = sample.plan.objective
        plans.append([plan is not None, plan is not None and plan.objective <= 1.05 * best])
    place = np.array(places)
    found, near = np.mean(plans, axis=0)
    return {
        "first": float((place < 1).mean()),
        "among 8": float((place < 8).mean()),
        "plan among 8": float(found),
        "within 5 % of the optimum": float(near),
    }


def splitting(samples: dict[str, list[Sample]], options: argparse.Namespace) -> list[Row]:
    """Objects of 12 facets, never seen in training."""
    examples = _examples(options, 2000)
    return [
        {
            "split facets": yes,
            "facets": kind,
            **ranks(trained(examples, splitting=yes, steps=options.steps), some),
        }
        for yes in (True, False)
        for kind, some in samples.items()
    ]


def data(samples: dict[str, list[Sample]], options: argparse.Namespace) -> list[Row]:
    """Sizes of the training set."""
    rows: list[Row] = []
    examples = _examples(options, max(options.sizes))
    for count in sorted({min(n, len(examples)) for n in options.sizes}):
        scorer = trained(examples[:count], splitting=True, steps=options.steps)
        rows += [
            {"training tasks": count, "facets": kind, **ranks(scorer, some)} for kind, some in samples.items()
        ]
    weights = load(SHIPPED, command="python -m dlm.structured.weights")
    policy = StructuredArchitecture().proposer()
    restore_weights(policy.weights(), weights, name="structured", source=SHIPPED)
    return rows + [
        {"training tasks": "10000 (shipped)", "facets": kind, **ranks(policy.scorer, some)}
        for kind, some in samples.items()
    ]


def _examples(options: argparse.Namespace, most: int | None) -> list[Example]:
    stored = read_dataset(options.data)
    return [Example.of(stored[i]) for i in range(len(stored) if most is None else min(most, len(stored)))]


STUDIES: dict[str, Callable[[dict[str, list[Sample]], argparse.Namespace], list[Row]]] = {
    "margin": margin,
    "top-k": top_k,
    "torque": torque,
    "gradient": gradient,
    "splitting": splitting,
    "data": data,
}


def write_extra(name: str, rows: list[Row], folder: Path) -> None:
    """One table as `dlm.evaluation.extras` reads it."""
    folder.mkdir(parents=True, exist_ok=True)
    doc = STUDIES[name].__doc__ or ""
    table = {
        "title": f"Structured model: {name}",
        "caption": doc.strip(),
        "command": f"python -m tests.benchmarks.ablations --only {name}",
        "columns": list(rows[0]),
        "rows": [[str(v) if isinstance(v, bool) else v for v in row.values()] for row in rows],
    }
    (folder / f"structured_{name}.json").write_text(json.dumps(table, indent=1))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--quick", action="store_true", help="12 tasks, 20 steps of training, the smoke data set"
    )
    parser.add_argument("--tasks", type=int, default=100)
    parser.add_argument("--steps", type=int, default=STEPS)
    parser.add_argument("--sizes", type=int, nargs="+", default=[20, 200, 2000, 10000], help="for `data`")
    parser.add_argument("--only", nargs="+", choices=list(STUDIES), default=list(STUDIES))
    parser.add_argument("--data", type=Path, default=Path("data/large-seed0"), help="training tasks")
    parser.add_argument("--folder", type=Path, default=Path("data"), help="where the fresh tasks are kept")
    parser.add_argument("--json", type=Path)
    parser.add_argument(
        "--extras", type=Path, help="folder for tables that `evaluate.py extras=[...]` can show"
    )
    options = parser.parse_args()
    if options.quick:
        options.tasks, options.steps = 12, 20
    torch.set_num_threads(1)
    console = Console(stderr=True)
    samples = {kind: fresh(kind, options.tasks, SEED + 1, options.folder) for kind in ("4-6", "12")}
    if options.quick:
        options.data = options.folder / f"fresh_4_6-seed{SEED + 1}-{options.tasks}"
    results = {}
    for name in options.only:
        with console.status(name):
            rows = results[name] = STUDIES[name](samples, options)
        table = Table(*rows[0], title=name)
        for row in rows:
            table.add_row(*(f"{v:.3g}" if isinstance(v, float) else str(v) for v in row.values()))
        Console(width=120).print(table)
        if options.extras:
            write_extra(name, rows, options.extras)
        if options.json:
            options.json.write_text(json.dumps(results, indent=1, default=str))
    return 0


if __name__ == "__main__":
    sys.exit(main())
