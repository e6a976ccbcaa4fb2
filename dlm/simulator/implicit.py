"""Derivatives of rollouts in one backward sweep over their steps."""

import numpy as np
from numba import njit

from dlm.simulator.adjoint import adjoint_step
from dlm.simulator.commands import pull_back
from dlm.simulator.rollout import Item, Plans, Run, acceptable, execute, item_of, run_for, table_of
from dlm.simulator.scene import SceneArrays
from dlm.simulator.world import State


@njit(cache=True, error_model="numpy", nogil=True)
def implicit_batch(
    scenes: SceneArrays, plans: Plans, settings: np.record, adjoint: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Gradients with respect to positions and forces (B, T, C, 2), given that of the knot poses (B, T, 3)."""
    d_positions, d_forces = np.zeros_like(plans.positions), np.zeros_like(plans.forces)
    run = run_for(scenes, plans, settings)
    command_bar = np.zeros_like(run.commands)
    for b in range(len(adjoint)):
        item = item_of(scenes, plans, b, settings)
        if not acceptable(item):
            continue
        table = table_of(item, settings)
        if not execute(item, table, run):
            continue
        first = _sweep_back(item, run, adjoint[b], settings.substeps, command_bar)
        pull_back(table, command_bar, item.world.stiffness, d_positions[b], d_forces[b])
        pull_back(table, first, np.inf, d_positions[b], d_forces[b])
        if not (np.isfinite(d_positions[b]).all() and np.isfinite(d_forces[b]).all()):
            d_positions[b], d_forces[b] = 0, 0
    return d_positions, d_forces


@njit(cache=True, error_model="numpy")
def _sweep_back(
    item: Item, run: Run, adjoint: np.ndarray, substeps: int, command_bar: np.ndarray
) -> np.ndarray:
    """Adjoints of the commands (S + 1, C, 2), and of the fingers' first positions (1, C, 2)."""
    motion, commands, work = run
    bar = State(np.zeros(3), np.zeros(3), np.zeros(commands.shape[1:]))
    command_bar[0] = 0
    for i in range(len(commands) - 1, 0, -1):
        if i % substeps == 0:
            bar.pose[:] += adjoint[i // substeps]
        before = State(motion.poses[i - 1], motion.velocities[i - 1], motion.fingers[i - 1])
        adjoint_step(item.world, before, commands[i], bar, command_bar[i], work)
    return bar.fingers.reshape((1, *commands.shape[1:]))
