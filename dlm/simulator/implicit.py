"""Derivatives of rollouts in one backward sweep over their steps."""

import numpy as np

from dlm.simulator.adjoint import adjoint_step
from dlm.simulator.commands import pull_back
from dlm.simulator.kernels import compiled
from dlm.simulator.rollout import (
    DONE,
    Item,
    Plans,
    Run,
    acceptable,
    advance,
    item_of,
    load_parts,
    move,
    run_of_plans,
    start_motion,
    table_of,
)
from dlm.simulator.scene import SceneArrays
from dlm.simulator.world import State, World


@compiled(nogil=True)
def implicit_batch(
    scenes: SceneArrays, plans: Plans, settings: np.record, adjoint: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Gradients with respect to positions and forces (B, T, C, 2), given that of the knot poses (B, T, 3)."""
    d_positions, d_forces = np.zeros_like(plans.positions), np.zeros_like(plans.forces)
    run = run_of_plans(scenes, plans, settings)
    command_bar = np.zeros_like(run.motion.commands)
    for b in range(len(adjoint)):
        item = item_of(scenes, plans, b, settings)
        if not acceptable(item):
            continue
        table = table_of(item, settings)
        start_motion(item, table, run.motion)
        if advance(item.world, run) != DONE:
            continue
        first = _sweep_back(item, run, adjoint[b], settings.substeps, command_bar)
        pull_back(table, command_bar, item.world.stiffness, d_positions[b], d_forces[b])
        pull_back(table, first, np.inf, d_positions[b], d_forces[b])
        if not (np.isfinite(d_positions[b]).all() and np.isfinite(d_forces[b]).all()):
            d_positions[b], d_forces[b] = 0, 0
    return d_positions, d_forces


@compiled
def _sweep_back(
    item: Item, run: Run, adjoint: np.ndarray, substeps: int, command_bar: np.ndarray
) -> np.ndarray:
    """Adjoints of the commands (S + 1, C, 2), and of the fingers' first positions (1, C, 2)."""
    motion, world = run.motion, item.world
    bar = State(np.zeros(3), np.zeros(3), np.zeros_like(motion.fingers[0]))
    command_bar[:] = 0
    for i in range(len(motion.parts) - 1, -1, -1):
        if (i + 1) % substeps == 0:
            bar.pose[:] += adjoint[(i + 1) // substeps]
        if motion.parts[i] == 1:
            before = State(motion.poses[i], motion.velocities[i], motion.fingers[i])
            adjoint_step(world, before, motion.commands[i : i + 2], bar, command_bar[i : i + 2], run.work)
        else:
            _sweep_back_parts(world, run, i, bar, command_bar)
    return bar.fingers.reshape((1, *motion.fingers.shape[1:]))


@compiled
def _sweep_back_parts(world: World, run: Run, i: int, bar: State, command_bar: np.ndarray) -> None:
    """The same for a step that was cut: its parts once more, and then back."""
    motion, fine, work = run
    parts, finer = motion.parts[i], load_parts(world, run, i)
    for j in range(parts - 1):
        move(finer, fine, j, motion.near[i], work)
    fine_bar = np.zeros((parts + 1, *motion.fingers.shape[1:]))
    for j in range(parts - 1, -1, -1):
        before = State(fine.poses[j], fine.velocities[j], fine.fingers[j])
        adjoint_step(finer, before, fine.commands[j : j + 2], bar, fine_bar[j : j + 2], work)
    for j in range(parts + 1):
        command_bar[i] += (1 - j / parts) * fine_bar[j]
        command_bar[i + 1] += (j / parts) * fine_bar[j]
