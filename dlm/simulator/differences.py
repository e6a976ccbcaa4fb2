"""Derivatives of rollouts by central differences, without repeating what a change cannot reach."""

import numpy as np
from numba import njit

from dlm.simulator.contact import view
from dlm.simulator.execution import Commands, command, plan_commands
from dlm.simulator.rollout import Motion, acceptable, advance, motion_for, start_motion
from dlm.simulator.scene import SceneArrays
from dlm.simulator.settings import Layers, Physics
from dlm.simulator.step import work_for


@njit(cache=True, error_model="numpy", nogil=True)
def difference_batch(
    scenes: SceneArrays,
    physics: Physics,
    layers: Layers,
    positions: np.ndarray,
    forces: np.ndarray,
    loaded: np.ndarray,
    start: np.ndarray,
    adjoint: np.ndarray,
    step: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Gradients as `implicit_batch` gives them: `step` [m] in positions, step * stiffness [N] in forces (the same commands)."""
    B, T, C = loaded.shape
    gradient = np.zeros((B, 2, T, C, 2))
    work = work_for(C, scenes.walls.shape[1])
    S = (T - 1) * layers.substeps
    base, other = motion_for(S + 1, C), motion_for(S + 1, C)
    commands, changed = np.zeros((S + 1, C, 2)), np.zeros((S + 1, C, 2))
    for b in range(B):
        if not acceptable(positions[b], forces[b]):
            continue
        scene, path = view(scenes, b), scenes.path[b]
        table = plan_commands(scene, path, positions[b], loaded[b], layers)
        command(table, positions[b], forces[b], scene.stiffness, commands)
        base.poses[0] = start[b]
        start_motion(table, positions[b], forces[b], base)
        if not advance(scene, physics, commands, 0, base, work):
            continue
        plan = np.stack((positions[b], forces[b]))
        for which, t, c, d in np.ndindex(plan.shape):
            bent = table.slope[t, c] != 0 or table.bend[t, c] != 0
            if which == 1 and not bent and acts_alike(table, t, c):
                gradient[b, 1, t, c, d] = gradient[b, 0, t, c, d] / scene.stiffness
                continue
            size = step if which == 0 else step * scene.stiffness
            total, kept = 0.0, plan[which, t, c, d]
            for sign in (1.0, -1.0):
                plan[which, t, c, d] = kept + sign * size
                moved = table
                if which == 0 and bent:
                    moved = plan_commands(scene, path, plan[0], loaded[b], layers)
                command(moved, plan[0], plan[1], scene.stiffness, changed)
                first = _restart(moved, plan, physics.damping, c, commands, changed, base, other)
                if first < S:
                    advance(scene, physics, changed, first, other, work)
                total += sign * _change_along(adjoint[b], first, layers.substeps, base.poses, other.poses)
            plan[which, t, c, d] = kept
            gradient[b, which, t, c, d] = total / (2 * size)
    return gradient[:, 0].copy(), gradient[:, 1].copy()


@njit(cache=True, error_model="numpy")
def _change_along(
    adjoint: np.ndarray, first: int, substeps: int, base: np.ndarray, other: np.ndarray
) -> float:
    """Change of the poses at the knots after substep `first`, along their adjoint (T, 3)."""
    total = 0.0
    for k in range(first // substeps + 1, len(adjoint)):
        for e in range(3):
            total += adjoint[k, e] * (other[k * substeps, e] - base[k * substeps, e])
    return total


@njit(cache=True, error_model="numpy")
def acts_alike(table: Commands, t: int, c: int) -> bool:
    """Whether force and position of finger c at knot t move the commands alike, and the start not at all."""
    for i in range(len(table.knot)):
        place, push = 0.0, 0.0
        for side in range(2):
            place += table.weight[i, c, side] * (table.knot[i, c, side] == t)
            push += table.force_weight[i, c, side] * (table.force_knot[i, c, side] == t)
        if place != push or (i == 0 and place != 0):
            return False
    return True


@njit(cache=True, error_model="numpy")
def _restart(
    table: Commands,
    plan: np.ndarray,
    damping: float,
    c: int,
    commands: np.ndarray,
    changed: np.ndarray,
    base: Motion,
    other: Motion,
) -> int:
    """Substep from which the changed commands of finger c act, with the state there copied from the unchanged motion.

    The number of substeps where they never do, because the finger is away from the object while they differ.
    """
    S = len(commands) - 1
    other.poses[0] = base.poses[0]
    start_motion(table, plan[0], plan[1], other)
    first, last = 0, S
    if (other.fingers[0] == base.fingers[0]).all():
        while first < S and (commands[first + 1] == changed[first + 1]).all():
            first += 1
    while damping == 0 and last > first and (commands[last] == changed[last]).all():
        last -= 1
    # A finger without mass and damper forgets within a step where it has been.
    if not base.near[first : min(last + 1, S), c].any():
        return S
    if first > 0:
        other.poses[first], other.velocities[first] = base.poses[first], base.velocities[first]
        other.fingers[first] = base.fingers[first]
    return first
