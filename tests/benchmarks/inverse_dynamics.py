"""The QP layer: does it find the expert's plan, which part of P does that need, how fast is it, and does it ever yield nan?

    python -m tests.benchmarks.inverse_dynamics [--quick] [--tasks 120] [--draws 10000] [--json FILE]

Bars: at the true P the optimum is the expert's plan on every task, for both backends, with eps = 0 (positions at contact
knots to 1e-4 L, forces to 1e-4 m g); no nan in the random draws.  Times are means per batch, forward and backward.
"""

import argparse
import json
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from rich.console import Console
from rich.progress import track
from rich.table import Table

from datasets.label import Label
from datasets.parameters import parameters_of
from dlm.inverse_dynamics.data import qp_data
from dlm.inverse_dynamics.layer import Action, InverseDynamics
from dlm.inverse_dynamics.parameters import ParameterBatch
from expert.problems.contact import ContactTask
from tests.dlm.inverse_dynamics.test_layer import LAYOUT, misses, random_rows, score
from tests.support.labelled import labels

BACKENDS = ("cvxpylayers", "batched")
WITHIN = 1e-4
Change = Callable[[ContactTask], ContactTask]


def truth_of(everyone: list[Label], change: Change = lambda task: task) -> ParameterBatch:
    """True parameters, or what they would be if the expert's task had been another."""
    return ParameterBatch.stack([parameters_of(change(one.task), one.plan) for one in everyone])


@torch.no_grad()
def matched(layer: InverseDynamics, P: ParameterBatch, everyone: list[Label], truth: ParameterBatch) -> float:
    """Share of tasks on which the optimum is the expert's plan."""
    action = layer(P)
    return float(((misses(action, everyone, truth) < WITHIN) & action.solved).double().mean())


class Slippery(InverseDynamics):
    """The program without 3-CT5: a finger may push as ever, but from another place at every step."""

    def forward(self, parameters: ParameterBatch) -> Action:
        data = qp_data(parameters, length=self.length, force=self.force, couple=True)
        data = replace(data, sticks=torch.zeros_like(data.sticks), slips=torch.ones_like(data.slips))
        p, lam, eps = self.program(data)
        solved = p.isfinite().flatten(1).all(1)
        return Action(positions=p * self.length, forces=lam * self.force, slack=eps, solved=solved)


def both_rays(truth: ParameterBatch) -> ParameterBatch:
    """Sliding ground contacts with a whole cone, as if they stuck."""
    mirror = truth.external_cones.new_tensor([-1.0, 1.0])
    first, second = truth.external_cones.unbind(-2)
    second = torch.where((first == second).all(-1, keepdim=True), mirror * first, second)
    return replace(truth, external_cones=torch.stack([first, second], dim=-2))


def ablations(everyone: list[Label], truth: ParameterBatch) -> dict[str, float]:
    """Matched share with one ingredient of P taken away."""
    layer = InverseDynamics(backend="batched", slack=None)
    free = torch.tensor([0.0, 1e3], dtype=torch.float64)
    poorer = {
        "force-free release": replace(truth, stick=truth.contact),
        "free-finger regions": replace(truth, region_normals=0 * truth.region_normals),
        "facet margin and wall clearance": truth_of(
            everyone, lambda k: replace(k, fingers=replace(k.fingers, facet_margin=0.0, clearance=0.0))
        ),
        "tightened cones": truth_of(
            everyone, lambda k: replace(k, robustness=replace(k.robustness, cone_fraction=1.0))
        ),
        "inset supports": truth_of(
            everyone, lambda k: replace(k, robustness=replace(k.robustness, support_inset=0.0))
        ),
        "one ray of sliding contacts": both_rays(truth),
        "force limits": replace(truth, force_limits=free.expand_as(truth.force_limits)),
    }
    shares = {f"without {name}": matched(layer, P, everyone, truth) for name, P in poorer.items()}
    thesis = InverseDynamics(backend="batched", slack=None, torque="thesis")
    slippery = Slippery(backend="batched", slack=None)
    return {
        **shares,
        "without sticking": matched(slippery, truth, everyone, truth),
        "torque: thesis": matched(thesis, truth, everyone, truth),
    }


def seconds_per_batch(layer: InverseDynamics, rows: torch.Tensor) -> tuple[float, float]:
    """Forward and backward; the better of two, after one unmeasured."""
    best = [np.inf, np.inf]
    for repetition in range(3):
        leaf = rows.clone().requires_grad_()
        start = time.perf_counter()
        action: Action = layer(LAYOUT.unflatten(leaf))
        middle = time.perf_counter()
        score(action).sum().backward()
        if repetition:
            best = [min(best[0], middle - start), min(best[1], time.perf_counter() - middle)]
    return best[0], best[1]


def random_draws(
    layer: InverseDynamics, truth: ParameterBatch, count: int, console: Console
) -> dict[str, float]:
    """Numbers of draws, of unsolved ones, and of those with a nan or inf in action or gradient."""
    unsolved = bad = 0
    batches = range(0, count, 50)
    for seed in track(batches, "random draws", console=console, disable=not console.is_terminal):
        rows = random_rows(truth, min(50, count - seed), seed).requires_grad_()
        action = layer(LAYOUT.unflatten(rows))
        (score(action).sum() + action.slack.abs().sum()).backward()
        values = (action.positions, action.forces, action.slack, rows.grad)
        finite = torch.stack([v.isfinite().flatten(1).all(1) for v in values]).all(0)
        unsolved, bad = unsolved + int((~action.solved).sum()), bad + int((~finite).sum())
    return {"draws": count, "unsolved": unsolved, "nan": bad}


def measure(count: int, batches: tuple[int, ...], draws: dict[str, int], console: Console) -> dict:
    """All figures of the tables."""
    everyone = [*labels(count // 2, (4, 6)), *labels(count - count // 2, (12, 12))]
    truth = truth_of(everyone)
    match, times, noise = {}, {}, {}
    generic = LAYOUT.flatten(truth)[torch.arange(128) % count]
    generic = generic + 0.03 * torch.randn(generic.shape, generator=torch.Generator().manual_seed(0)).double()
    for backend in BACKENDS:
        for slack in (None, 300.0, 100.0):
            layer = InverseDynamics(backend=backend, slack=slack)
            match[f"{backend}, q = {slack or 'infinite (eps = 0)'}"] = matched(layer, truth, everyone, truth)
        layer = InverseDynamics(backend=backend)
        for batch in batches:
            times[f"{backend} {batch}"] = seconds_per_batch(layer, generic[:batch])
        noise[backend] = random_draws(layer, truth, draws[backend], console)
    return {"tasks": count, "match": match | ablations(everyone, truth), "seconds": times, "noise": noise}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="12 tasks, 500 draws, no batch of 128")
    parser.add_argument("--tasks", type=int, default=120)
    parser.add_argument("--draws", type=int, default=10_000)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    console = Console(stderr=True)
    torch.set_num_threads(1)
    tasks, draws = (12, 500) if options.quick else (options.tasks, options.draws)
    batches = (1, 20) if options.quick else (1, 20, 128)
    # Through DIFFCP a draw takes some 30 times longer.
    result = measure(tasks, batches, {"batched": draws, "cvxpylayers": draws // 10}, console)
    _print(result)
    if options.json:
        options.json.write_text(json.dumps(result, indent=1))
    exact = all(share == 1 for name, share in result["match"].items() if "eps = 0" in name)
    return 0 if exact and all(n["nan"] == 0 for n in result["noise"].values()) else 1


def _print(result: dict) -> None:
    console = Console()
    table = Table("P and layer", "match", "bar", title=f"expert's plan found, of {result['tasks']} tasks")
    for name, share in result["match"].items():
        table.add_row(name, f"{share:.3f}", "1" if "eps = 0" in name else "")
    console.print(table)
    table = Table("backend, batch", "forward ms", "backward ms", "cvxpylayers / this")
    for name, (forward, backward) in result["seconds"].items():
        slow = sum(result["seconds"][f"cvxpylayers {name.split()[1]}"])
        table.add_row(
            name, f"{1e3 * forward:.1f}", f"{1e3 * backward:.1f}", f"{slow / (forward + backward):.1f}"
        )
    console.print(table)
    for backend, n in result["noise"].items():
        console.print(
            f"{backend}: {n['draws']} random draws, {n['unsolved']} unsolved, {n['nan']} with nan (bar: 0)"
        )


if __name__ == "__main__":
    sys.exit(main())
