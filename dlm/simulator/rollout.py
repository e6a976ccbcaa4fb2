"""Whole motions: execution layer and time steps for one scene, and loops over batches.

Scenes are simulated one after the other by the same compiled code, so that a batch equals its single runs bit for bit.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from dlm.simulator.contact import View, view
from dlm.simulator.execution import Commands, command, plan_commands
from dlm.simulator.scene import SceneArrays
from dlm.simulator.settings import Layers, Physics
from dlm.simulator.step import Work, solve_step, work_for


class Motion(NamedTuple):
    """States at every substep: poses and velocities (S + 1, 3), fingers (S + 1, C, 2).

    exact (S,): the contact problem was solved exactly; near (S, C): the finger was near enough to take part in it.
    """

    poses: np.ndarray
    velocities: np.ndarray
    fingers: np.ndarray
    exact: np.ndarray
    near: np.ndarray


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
def advance(
    scene: View, physics: Physics, commands: np.ndarray, start: int, motion: Motion, work: Work
) -> bool:
    """Continue `motion` from substep `start` under commands (S + 1, C, 2).

    Returns False, and holds the last finite state for good, where numbers overflow.
    """
    h = scene.dt / physics.substeps
    for i in range(start, len(commands) - 1):
        q, v, p = motion.poses[i], motion.velocities[i], motion.fingers[i]
        n, motion.exact[i] = solve_step(scene, physics, q, v, p, commands[i + 1], work)
        for c in range(len(p)):
            motion.near[i, c] = False
        for k in range(n):
            if work.contacts[k].finger >= 0:
                motion.near[i, work.contacts[k].finger] = True
        for d in range(3):
            motion.velocities[i + 1, d] = work.velocity[d]
            motion.poses[i + 1, d] = q[d] + h * work.velocity[d]
        for c in range(len(p)):
            for d in range(2):
                motion.fingers[i + 1, c, d] = p[c, d] + h * work.finger_velocity[c, d]
        if not finite(motion, i + 1):
            for j in range(i + 1, len(commands)):
                motion.poses[j], motion.velocities[j], motion.fingers[j] = q, v, p
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
def start_motion(table: Commands, positions: np.ndarray, forces: np.ndarray, motion: Motion) -> None:
    """Object at rest at its first pose, fingers where the plan has them."""
    command(table, positions, forces, np.inf, motion.fingers[:1])
    motion.velocities[0] = 0


@njit(cache=True, error_model="numpy")
def acceptable(positions: np.ndarray, forces: np.ndarray) -> bool:
    """Whether a plan is made of finite numbers that leave room to compute with."""
    return np.abs(positions).max() < 1e100 and np.abs(forces).max() < 1e100


@njit(cache=True, error_model="numpy", nogil=True)
def execute_batch(
    scenes: SceneArrays,
    physics: Physics,
    layers: Layers,
    positions: np.ndarray,
    forces: np.ndarray,
    loaded: np.ndarray,
    start: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Poses at the knots (B, T, 3) and status (B,) of plans (B, T, C, 2), from start poses (B, 3).

    A plan that is not finite leaves its object where it is and gets status False.
    """
    B, T, C = loaded.shape
    poses, ok = np.zeros((B, T, 3)), np.zeros(B, np.bool_)
    work = work_for(C, scenes.walls.shape[1])
    samples = (T - 1) * layers.substeps + 1
    motion, commands = motion_for(samples, C), np.zeros((samples, C, 2))
    for b in range(B):
        poses[b, :] = start[b]
        if not acceptable(positions[b], forces[b]):
            continue
        scene = view(scenes, b)
        table = plan_commands(scene, scenes.path[b], positions[b], loaded[b], layers)
        command(table, positions[b], forces[b], scene.stiffness, commands)
        motion.poses[0] = start[b]
        start_motion(table, positions[b], forces[b], motion)
        ok[b] = advance(scene, physics, commands, 0, motion, work)
        for t in range(T):
            poses[b, t] = motion.poses[t * layers.substeps]
    return poses, ok
