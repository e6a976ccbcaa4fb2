"""The simulator: speed, gradients, agreement with MuJoCo, execution of expert plans, convergence, optimisation.

    python -m tests.benchmarks.simulator [--quick] [--only timing gradients ...] [--json FILE]

Times are processor time of one thread, the best of several repetitions.  Exits 1 where a stated bar is missed.
"""

import argparse
import json
import sys
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numba import njit
from rich.console import Console
from rich.progress import track
from rich.table import Table

from dlm.metrics import object_trajectory_loss, rotation_error, translation_error, within
from dlm.simulator import Execution, Scene, SceneBatch, SimulatorSettings, replay
from dlm.simulator.gradient import rollout
from dlm.simulator.mujoco import replay_in_mujoco
from dlm.simulator.rollout import (
    Plans,
    Run,
    advance,
    item_of,
    load_parts,
    move,
    run_of_plans,
    start_motion,
    table_of,
)
from dlm.simulator.step import solve_step
from dlm.simulator.world import State, World
from expert.geometry.pose import Array
from expert.world.environment import Environment
from tests.support.expert_plans import Planned, planned_tasks, transverse_tasks
from tests.support.scenes import batch_of, push, random_case

SEED = 20_261
ROLLOUT_BAR, DIFFERENCE_BAR, IMPLICIT_BAR = 0.1, 5.0, 2.0
"""Milliseconds per rollout, and per sample of a batch of 20 for either gradient."""
ABLATIONS = {
    "all on": Execution(),
    "straight lines": Execution(material_point=False),
    "constant speed": Execution(eased=False),
    "no compensation": Execution(compensation=False),
    "no approach, no release": Execution(approach=0, release=0),
    "no handover": Execution(handover=False),
    "no lift-off": Execution(lift_off=0),
    "no parking": Execution(parking=0),
    "all off": Execution(
        material_point=False,
        eased=False,
        compensation=False,
        approach=0,
        release=0,
        lift_off=0,
        parking=0,
    ),
}

PROGRESS = Console(stderr=True)


@dataclass
class Report:
    """Numbers by section, and bars: name, value, relation, limit."""

    sections: dict[str, Any] = field(default_factory=dict)
    bars: list[tuple[str, float, str, float]] = field(default_factory=list)

    def bar(self, name: str, value: float, relation: str, limit: float) -> None:
        self.bars.append((name, float(value), relation, limit))

    @property
    def missed(self) -> list[str]:
        return [
            n
            for n, value, relation, limit in self.bars
            if not (value <= limit if relation == "<=" else value >= limit)
        ]


@dataclass(frozen=True)
class Material:
    """What the sections work on."""

    few: list[Planned]
    many: list[Planned]
    table: list[Planned]
    quick: bool


def arrays(
    plans: list[Planned], scenes: list[Scene] | None = None
) -> tuple[SceneBatch, torch.Tensor, torch.Tensor]:
    batch = SceneBatch.of(scenes or [Scene.of(p.task) for p in plans])
    positions = torch.tensor(np.array([p.plan.positions for p in plans]), requires_grad=True)
    forces = torch.tensor(np.array([p.plan.forces for p in plans]), requires_grad=True)
    return batch, positions, forces


def best(run: Callable[[], object], repetitions: int) -> float:
    """Least processor time [s]; the first run compiles."""
    run()
    times = []
    for _ in range(repetitions):
        began = time.process_time()
        run()
        times.append(time.process_time() - began)
    return min(times)


def timing(material: Material, report: Report) -> None:
    """Rollouts of 800 expert plans; gradients of batches of 20."""
    plans = (material.few * 800)[:800]
    batch, p, f = arrays(plans)
    repetitions = 5 if material.quick else 15
    rollout_ms = best(lambda: rollout(batch, p, f), repetitions) / 800 * 1e3
    numbers = {
        "rollout_ms": rollout_ms,
        "rollout_single_ms": best(lambda: rollout(batch[:1], p[:1], f[:1]), 50) * 1e3,
    }
    for gradient in ("finite_difference", "implicit"):
        numbers[f"{gradient}_ms"] = backward_ms(batch[:20], p[:20], f[:20], gradient, repetitions)
        numbers[f"{gradient}_100_ms"] = backward_ms(batch[:100], p[:100], f[:100], gradient, 3)
    report.sections["timing"] = numbers
    report.bar("rollout, 800 at once, ms", rollout_ms, "<=", ROLLOUT_BAR)
    report.bar(
        "finite differences, batch 20, ms per sample", numbers["finite_difference_ms"], "<=", DIFFERENCE_BAR
    )
    report.bar("implicit, batch 20, ms per sample", numbers["implicit_ms"], "<=", IMPLICIT_BAR)


def backward_ms(
    batch: SceneBatch, p: torch.Tensor, f: torch.Tensor, gradient: Any, repetitions: int
) -> float:
    p, f = (x.detach().clone().requires_grad_() for x in (p, f))
    poses = rollout(batch, p, f, SimulatorSettings(gradient=gradient))
    loss = ((poses - torch.tensor(batch.desired)) ** 2).sum()
    return best(lambda: torch.autograd.grad(loss, (p, f), retain_graph=True), repetitions) / len(batch) * 1e3


def gradients(material: Material, report: Report) -> None:
    """Implicit derivatives, and differences at the default step, against central differences at 1e-6 m."""
    count = 100 if material.quick else 500
    rng = np.random.default_rng(SEED)
    cosines: dict[str, list[float]] = {"implicit": [], "default": []}
    compared, skipped = 0.0, 0
    for _ in track(range(count), "gradients", console=PROGRESS, disable=not PROGRESS.is_terminal):
        case = random_case(rng)
        weights = rng.normal(size=case.scene.trajectory.poses.shape) * [1, 1, 0.03]
        reference, steady = reference_gradient(case.scene, case.positions, case.forces, weights, 1e-6)
        if steady.mean() < 0.5:
            skipped += 1
            continue
        compared += steady.mean()
        for name, settings in (
            ("implicit", SimulatorSettings(gradient="implicit")),
            ("default", SimulatorSettings(gradient="finite_difference")),
        ):
            batch, p, f = batch_of([case])
            loss = (rollout(batch, p, f, settings) * torch.tensor(weights)).sum()
            d_p, d_f = torch.autograd.grad(loss, (p, f))
            ours = np.concatenate([d_p.numpy().ravel(), case.scene.stiffness * d_f.numpy().ravel()])[steady]
            length = np.linalg.norm(ours) * np.linalg.norm(reference[steady])
            if length > 1e-12:
                cosines[name].append(float(ours @ reference[steady] / length))
    exact, default = np.array(cosines["implicit"]), np.array(cosines["default"])
    report.sections["gradients"] = {
        "scenes": count,
        "with_mode_switches_in_most_entries": skipped,
        "share_of_entries_compared": compared / max(count - skipped, 1),
        "implicit_median": float(np.median(exact)),
        "implicit_p05": float(np.quantile(exact, 0.05)),
        "default_step_median": float(np.median(default)),
        "default_step_p05": float(np.quantile(default, 0.05)),
    }
    report.bar("implicit cosine, median", float(np.median(exact)), ">=", 0.999)
    report.bar("implicit cosine, 5th percentile", float(np.quantile(exact, 0.05)), ">=", 0.99)


def reference_gradient(
    scene: Scene, positions: Array, forces: Array, weights: Array, step: float
) -> tuple[Array, np.ndarray]:
    """Central differences with respect to positions and force / stiffness, and where no contact changed its state."""
    batch, numbers = SceneBatch.of([scene]), SimulatorSettings().numbers
    loaded, start = batch.loaded(forces[None]), batch.desired[:, 0].copy()
    plan = np.stack([positions, forces / scene.stiffness])

    def run(values: Array) -> tuple[float, np.ndarray]:
        plans = Plans(values[:1].copy(), values[1:] * scene.stiffness, loaded, start)
        item, memory = item_of(batch.arrays, plans, 0, numbers), run_of_plans(batch.arrays, plans, numbers)
        start_motion(item, table_of(item, numbers), memory.motion)
        advance(item.world, memory)
        knots = memory.motion.poses[:: numbers["substeps"]]
        return float((knots * weights).sum()), modes(item.world, memory)

    _, base = run(plan)
    gradient, steady = np.zeros(plan.size), np.zeros(plan.size, dtype=bool)
    for k in range(plan.size):
        ends = []
        for sign in (1, -1):
            moved = plan.copy()
            moved.reshape(-1)[k] += sign * step
            ends.append(run(moved))
        gradient[k] = (ends[0][0] - ends[1][0]) / (2 * step)
        steady[k] = (ends[0][1] == base).all() and (ends[1][1] == base).all()
    return gradient, steady


@njit
def modes(world: World, run: Run) -> np.ndarray:
    """A number per substep that stands for the features in contact and their states."""
    motion, fine, work = run
    out = motion.parts.copy()
    for i in range(len(out)):
        finer = load_parts(world, run, i)
        for j in range(motion.parts[i]):
            before = State(fine.poses[j], fine.velocities[j], fine.fingers[j])
            n, _ = solve_step(finer, before, fine.commands[j : j + 2], work)
            for k in range(n):
                c = work.problem.contacts[k]
                if c.state > 0:
                    name = ((c.kind * 8 + c.finger + 1) * 64 + c.feature) * 8 + c.wall + 1
                    out[i] = out[i] * 1_000_003 + name * 4 + c.state
            move(finer, fine, j, motion.near[i], work)
    return out


def outcomes(
    plans: list[Planned],
    settings: SimulatorSettings | None = None,
    scenes: list[Scene] | None = None,
    start: Array | None = None,
) -> tuple[Array, Array]:
    """Poses (n, T, 3) in the simulator, and the desired ones."""
    batch, p, f = arrays(plans, scenes)
    return rollout(batch, p, f, settings, start=start).detach().numpy(), batch.desired


def execution(material: Material, report: Report) -> None:
    """Expert plans end where they should; what each layer of the execution contributes; what errors do."""
    numbers: dict[str, Any] = {}
    for name, plans in (
        ("4 to 6 facets", material.few),
        ("12 facets", material.many),
        ("table", material.table),
    ):
        got, desired = outcomes(plans)
        loss, ok = object_trajectory_loss(got, desired), within(got, desired)
        numbers[name] = {
            "plans": len(plans),
            "within": float(ok.mean()),
            "median_loss": float(np.median(loss)),
            "mean_loss": float(loss.mean()),
            "median_mm": float(np.median(translation_error(got, desired)[:, -1])),
            "failed": [f"{k}: {plans[k].family}, {loss[k]:.2g} cm^2" for k in np.flatnonzero(~ok)],
        }
    report.bar("4 to 6 facets within 2 mm, 2 deg", numbers["4 to 6 facets"]["within"], ">=", 0.95)
    report.bar("12 facets within 2 mm, 2 deg", numbers["12 facets"]["within"], ">=", 0.92)
    report.bar("4 to 6 facets, median loss, cm^2", numbers["4 to 6 facets"]["median_loss"], "<=", 1e-3)
    report.sections["execution"] = numbers
    plans = material.few + material.many
    report.sections["ablation"] = {
        name: share(*outcomes(plans, SimulatorSettings(execution=e))) for name, e in ABLATIONS.items()
    }
    report.sections["sensitivity"] = sensitivity(plans)


def share(got: Array, desired: Array) -> dict[str, float]:
    loss = object_trajectory_loss(got, desired)
    return {
        "within": float(within(got, desired).mean()),
        "median_loss": float(np.median(loss)),
        "mean_loss": float(loss.mean()),
    }


def sensitivity(plans: list[Planned]) -> dict[str, dict[str, float]]:
    """Of plans made for the nominal scene: offsets are measured against the desired motion shifted by them."""
    rng = np.random.default_rng(SEED)
    nominal = [Scene.of(p.task) for p in plans]
    table = {}
    for mm in (0.5, 1.0, 2.0):
        angle = rng.uniform(0, 2 * np.pi, len(plans))
        shift = (
            1e-3 * mm * np.column_stack([np.cos(angle), np.abs(np.sin(angle)), 0 * angle])
        )  # never into the floor
        start = np.array([s.trajectory.poses[0] for s in nominal]) + shift
        got, desired = outcomes(plans, start=start)
        table[f"start {mm} mm off"] = share(got, desired)
    table["friction x 0.8"] = share(*outcomes(plans, scenes=[rubbed(s, 0.8) for s in nominal]))
    table["mass x 1.3"] = share(*outcomes(plans, scenes=[heavier(s, 1.3) for s in nominal]))
    return table


def rubbed(scene: Scene, factor: float) -> Scene:
    e = scene.environment
    walls = tuple(replace(w, friction=factor * w.friction) for w in e.walls)
    return replace(scene, friction=factor * scene.friction, environment=replace(e, walls=walls))


def heavier(scene: Scene, factor: float) -> Scene:
    body = replace(scene.body, mass=factor * scene.body.mass, inertia=factor * scene.body.inertia)
    return replace(scene, body=body)


def mujoco(material: Material, report: Report) -> None:
    """End poses of both engines: between each other, and against the goal."""
    numbers = {}
    for name, plans, mm, deg in (
        ("sagittal", material.few, 0.5, 1.0),
        ("table", material.table, 1.0, 2.0),
    ):
        chosen = plans[:48] if material.quick else plans
        theirs = np.array(
            [
                replay_in_mujoco(p.task, p.plan.positions, p.plan.forces).poses
                for p in track(chosen, f"MuJoCo, {name}", console=PROGRESS, disable=not PROGRESS.is_terminal)
            ]
        )
        ours, desired = outcomes(chosen)
        agree = within(ours, theirs, mm=mm, deg=deg)
        reached = within(theirs, desired)
        apart = translation_error(ours, theirs)[:, -1], rotation_error(ours, theirs)[:, -1]
        numbers[name] = {
            "plans": len(chosen),
            "agree": float(agree.mean()),
            "median_apart_mm": float(np.median(apart[0])),
            "median_apart_deg": float(np.median(apart[1])),
            "within_in_mujoco": float(reached.mean()),
            "outliers": [
                f"{k}: {chosen[k].family}, {apart[0][k]:.2f} mm, {apart[1][k]:.2f} deg, {cause(chosen[k], ours[k], theirs[k])}"
                for k in np.flatnonzero(~agree)
            ],
        }
        report.bar(f"MuJoCo agrees within {mm} mm, {deg} deg, {name}", agree.mean(), ">=", 0.90)
    report.bar("MuJoCo within 2 mm, 2 deg of the goal", numbers["sagittal"]["within_in_mujoco"], ">=", 0.93)
    report.sections["mujoco"] = numbers


def cause(planned: Planned, ours: Array, theirs: Array) -> str:
    """Who is off, and whether MuJoCo agrees with itself at half its step."""
    half = replay_in_mujoco(planned.task, planned.plan.positions, planned.plan.forces, timestep=1.25e-4).poses
    desired = planned.task.trajectory.poses
    off = [name for name, got in (("we", ours), ("MuJoCo", theirs)) if not within(got, desired)]
    itself = "agrees" if within(theirs, half, mm=0.5, deg=1.0) else "disagrees"
    return f"off the goal: {' and '.join(off) or 'neither'}; MuJoCo {itself} with itself at half step"


def convergence(material: Material, report: Report) -> None:
    """End pose of expert plans with half the substep; of random scenes, which tumble, with an eighth of it."""
    plans = material.few + material.many
    coarse, _ = outcomes(plans)
    fine, _ = outcomes(plans, SimulatorSettings(substeps=40))
    apart = translation_error(coarse, fine)[:, -1]
    rng = np.random.default_rng(SEED)
    batch, p, f = batch_of([random_case(rng) for _ in range(200)])
    tumbled, finer = (rollout(batch, p, f, SimulatorSettings(substeps=n)).detach().numpy() for n in (20, 160))
    alike = within(tumbled, finer, mm=0.5, deg=1.0).mean()
    report.sections["convergence"] = {
        "plans": len(plans),
        "share_within_0.3_mm": float((apart <= 0.3).mean()),
        "median_mm": float(np.median(apart)),
        "p95_mm": float(np.quantile(apart, 0.95)),
        "random_scenes_within_0.5_mm_1_deg": float(alike),
        "random_scenes_median_mm": float(np.median(translation_error(tumbled, finer)[:, -1])),
    }
    report.bar("half the substep moves the end by <= 0.3 mm, share", (apart <= 0.3).mean(), ">=", 0.90)
    report.bar("an eighth of the substep: random scenes within 0.5 mm, 1 deg", alike, ">=", 0.90)


def laws(material: Material, report: Report) -> None:
    """Momentum and cones over expert plans and random scenes, and contact problems with several solutions."""
    rng = np.random.default_rng(SEED)
    cases = [random_case(rng) for _ in range(50 if material.quick else 200)]
    triples = [(p.task, p.plan.positions, p.plan.forces) for p in material.few]
    triples += [(c.scene, c.positions, c.forces) for c in cases]
    records = [replay(*t) for t in triples]
    report.sections["laws"] = {
        "steps": sum(len(r.work) for r in records),
        "momentum_N": max(r.momentum_residual for r in records),
        "cones_N": max(r.cone_residual for r in records),
        "with_several_solutions": sum(r.several for r in records),
        "not_looked_at_for_several": sum(r.unchecked for r in records),
    }
    report.bar("momentum residual, N", max(r.momentum_residual for r in records), "<=", 1e-9)
    report.bar("cone residual, N", max(r.cone_residual for r in records), "<=", 1e-6)


def optimisation(material: Material, report: Report) -> None:
    """A finger that starts too far behind the block to ever touch it learns to push it, by annealed smoothing."""
    start, end, steady = descend(annealed=True)
    rigid_start, rigid_end, gradient = descend(annealed=False)
    report.sections["optimisation"] = {
        "loss_before": start,
        "loss_after_annealed": end,
        "loss_after_rigid": rigid_end,
        "rigid_gradient_norm": gradient,
        "annealed_gradient_norm": steady,
    }
    report.bar("annealed smoothing reduces the loss, share", 1 - end / start, ">=", 0.60)
    report.bar("rigid gradient at the start", gradient, "<=", 0.0)
    del rigid_start


def descend(annealed: bool, steps: int = 60) -> tuple[float, float, float]:
    """Rigid loss [cm^2] before and after Adam, and the norm of the first gradient."""
    case = push()
    scene = replace(case.scene, environment=Environment(walls=case.scene.environment.walls))
    batch, straight = SceneBatch.of([scene]), Execution(material_point=False)
    goal = torch.tensor(batch.desired)
    p = torch.tensor(np.repeat(case.positions[None, :1] - [0.01, 0], 5, axis=1), requires_grad=True)
    flags, forces = np.ones((1, 5, 2), dtype=bool), torch.zeros(1, 5, 2, 2, dtype=torch.float64)
    flags[..., 1] = False

    def loss(kappa: float) -> torch.Tensor:
        settings = SimulatorSettings(gradient="implicit", kappa=kappa, execution=straight)
        return object_trajectory_loss(rollout(batch, p, forces, settings, contact=flags), goal).sum()

    optimiser = torch.optim.Adam([p], lr=2e-3)
    before, first = loss(np.inf).item(), 0.0
    for k in range(steps):
        optimiser.zero_grad()
        loss(100 * 25 ** (k / (steps - 1)) if annealed else np.inf).backward()
        first = p.grad.norm().item() if k == 0 else first
        optimiser.step()
    return before, loss(np.inf).item(), first


SECTIONS: dict[str, Callable[[Material, Report], None]] = {
    f.__name__: f for f in (timing, gradients, execution, mujoco, convergence, laws, optimisation)
}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="fewer tasks, within a minute once compiled")
    parser.add_argument("--only", nargs="+", choices=list(SECTIONS), default=list(SECTIONS))
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    torch.set_num_threads(1)
    sizes = (48, 24, 12) if options.quick else (240, 120, 60)
    few, few_failed = planned_tasks(sizes[0], (4, 6), SEED)
    many, many_failed = planned_tasks(sizes[1], (12, 12), SEED)
    table, table_failed = transverse_tasks(sizes[2], SEED)
    report = Report()
    report.sections["tasks"] = {
        "4 to 6 facets": dict(Counter(p.family for p in few)),
        "12 facets": dict(Counter(p.family for p in many)),
        "table": len(table),
        "draws_without_plan": {"4 to 6 facets": few_failed, "12 facets": many_failed, "table": table_failed},
    }
    material = Material(few, many, table, options.quick)
    for name in options.only:
        SECTIONS[name](material, report)
    show(report)
    if options.json:
        options.json.write_text(
            json.dumps({**report.sections, "bars": report.bars, "missed": report.missed}, indent=1)
        )
    return 1 if report.missed else 0


def show(report: Report) -> None:
    console = Console()
    for name, numbers in report.sections.items():
        table = Table("quantity", "value", title=name)
        for key, value in numbers.items():
            table.add_row(
                key,
                "\n".join(f"{k}: {_text(v)}" for k, v in value.items())
                if isinstance(value, dict)
                else _text(value),
            )
        console.print(table)
    table = Table("bar", "value", "limit", "", title="bars")
    for name, value, relation, limit in report.bars:
        table.add_row(
            name, _text(value), f"{relation} {limit:g}", "MISSED" if name in report.missed else "ok"
        )
    console.print(table)


def _text(value: object) -> str:
    if isinstance(value, list):
        return "\n".join(map(str, value)) or "none"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


if __name__ == "__main__":
    sys.exit(main())
