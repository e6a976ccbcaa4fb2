"""Whole motions: execution layer and time steps for one scene, and loops over batches.

Scenes are simulated one after the other by the same compiled code, so that a batch equals its single runs bit for bit.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from dlm.simulator.commands import Commands, command
from dlm.simulator.execution import plan_commands
from dlm.simulator.scene import SceneArrays
from dlm.simulator.step import Work, solve_step, work_for
from dlm.simulator.world import State, World, world_of


class Plans(NamedTuple):
    """What B scenes are asked to do: positions and forces (B, T, C, 2), flags loaded (B, T, C), first poses start (B, 3)."""

    positions: np.ndarray
    forces: np.ndarray
    loaded: np.ndarray
    start: np.ndarray


class Motion(NamedTuple):
    """States at every substep: poses and velocities (S + 1, 3), fingers (S + 1, C, 2).

    exact (S,): the contact problem was solved exactly; near (S, C): the finger was near enough to take part in it.
    """

    poses: np.ndarray
    velocities: np.ndarray
    fingers: np.ndarray
    exact: np.ndarray
    near: np.ndarray


class Run(NamedTuple):
    """Memory of one scene's execution: its motion, the commands (S + 1, C, 2) that it follows, and scratch."""

    motion: Motion
    commands: np.ndarray
    work: Work


class Item(NamedTuple):
    """One scene of a batch with its plan: desired path (T, 3), positions, forces (T, C, 2), loaded (T, C), start (3,)."""

    world: World
    path: np.ndarray
    positions: np.ndarray
    forces: np.ndarray
    loaded: np.ndarray
    start: np.ndarray


@njit(cache=True, error_model="numpy")
def motion_for(samples: int, fingers: int) -> Motion:
    """Empty states."""
    return Motion(
        np.zeros((samples, 3)),
        np.zeros((samples, 3)),
        np.zeros((samples, fingers, 2)),
        np.ones(samples - 1, np.bool_),
        np.zeros((samples - 1, fingers), np.bool_),
    )


@njit(cache=True, error_model="numpy")
def run_for(scenes: SceneArrays, plans: Plans, settings: np.record) -> Run:
    """Memory for any scene of a batch."""
    _, T, C = plans.loaded.shape
    samples = (T - 1) * settings.substeps + 1
    return Run(motion_for(samples, C), np.zeros((samples, C, 2)), work_for(C, scenes.walls.shape[1]))


@njit(cache=True, error_model="numpy")
def item_of(scenes: SceneArrays, plans: Plans, b: int, settings: np.record) -> Item:
    """Scene and plan b."""
    world, path = world_of(scenes, b, settings), scenes.path[b]
    return Item(world, path, plans.positions[b], plans.forces[b], plans.loaded[b], plans.start[b])


@njit(cache=True, error_model="numpy")
def table_of(item: Item, settings: np.record) -> Commands:
    """How the commands depend on the plan."""
    return plan_commands(item.world, item.path, item.positions, item.loaded, settings)


@njit(cache=True, error_model="numpy")
def execute(item: Item, table: Commands, run: Run) -> bool:
    """Commands and motion of one plan; False where numbers overflow."""
    command(table, item.positions, item.forces, item.world.stiffness, run.commands)
    start_motion(item, table, run.motion)
    return advance(item.world, run, 0)


@njit(cache=True, error_model="numpy")
def start_motion(item: Item, table: Commands, motion: Motion) -> None:
    """Object at rest at its first pose, fingers where the plan has them."""
    motion.poses[0], motion.velocities[0] = item.start, 0
    command(table, item.positions, item.forces, np.inf, motion.fingers[:1])


@njit(cache=True, error_model="numpy")
def advance(world: World, run: Run, start: int) -> bool:
    """Continue the motion from substep `start` under the run's commands.

    Returns False, and holds the last finite state for good, where numbers overflow.
    """
    motion, commands, work = run
    velocity, finger_velocity, contacts = work.velocity, work.finger_velocity, work.problem.contacts
    poses, velocities, fingers, exact, near = motion
    for i in range(start, len(commands) - 1):
        n, exact[i] = solve_step(world, State(poses[i], velocities[i], fingers[i]), commands[i + 1], work)
        for c in range(near.shape[1]):
            near[i, c] = False
        for k in range(n):
            if contacts[k].finger >= 0:
                near[i, contacts[k].finger] = True
        for d in range(3):
            velocities[i + 1, d] = velocity[d]
            poses[i + 1, d] = poses[i, d] + world.h * velocity[d]
        for c in range(near.shape[1]):
            for d in range(2):
                fingers[i + 1, c, d] = fingers[i, c, d] + world.h * finger_velocity[c, d]
        if not finite(motion, i + 1):
            for j in range(i + 1, len(commands)):
                poses[j], velocities[j], fingers[j] = poses[i], velocities[i], fingers[i]
            return False
    return True


@njit(cache=True, error_model="numpy")
def finite(motion: Motion, i: int) -> bool:
    """Whether state i is made of finite numbers."""
    total = 0.0
    for d in range(3):
        total += abs(motion.poses[i, d]) + abs(motion.velocities[i, d])
    for c in range(motion.fingers.shape[1]):
        total += abs(motion.fingers[i, c, 0]) + abs(motion.fingers[i, c, 1])
    return np.isfinite(total)


@njit(cache=True, error_model="numpy")
def acceptable(item: Item) -> bool:
    """Whether a plan is made of finite numbers that leave room to compute with."""
    return np.abs(item.positions).max() < 1e100 and np.abs(item.forces).max() < 1e100


@njit(cache=True, error_model="numpy", nogil=True)
def execute_batch(scenes: SceneArrays, plans: Plans, settings: np.record) -> tuple[np.ndarray, np.ndarray]:
    """Poses at the knots (B, T, 3) and status (B,).

    A plan that is not finite leaves its object where it is and gets status False.
    """
    B, T, _ = plans.loaded.shape
    poses, ok = np.zeros((B, T, 3)), np.zeros(B, np.bool_)
    run = run_for(scenes, plans, settings)
    for b in range(B):
        item = item_of(scenes, plans, b, settings)
        poses[b, :] = item.start
        if acceptable(item):
            ok[b] = execute(item, table_of(item, settings), run)
            poses[b] = run.motion.poses[:: settings.substeps]
    return poses, ok
