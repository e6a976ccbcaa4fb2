"""Derivatives of rollouts by central differences, the thesis's method, without repeating what a change cannot reach."""

import numpy as np

from dlm.simulator.commands import Commands
from dlm.simulator.kernels import borrowing, compiled
from dlm.simulator.rollout import (
    DONE,
    Item,
    Plans,
    Run,
    acceptable,
    advance,
    advance_alike,
    copy_state,
    item_of,
    run_of_plans,
    start_motion,
    table_of,
)
from dlm.simulator.scene import SceneArrays

POSITION, FORCE = 0, 1
"""First index of the entries of a plan."""


@compiled(nogil=True)
def difference_batch(
    scenes: SceneArrays, plans: Plans, settings: np.record, adjoint: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Gradients as `implicit_batch` gives them: by a step [m] in positions, step * stiffness [N] in forces (the same commands)."""
    B, T, C = plans.loaded.shape
    gradient = np.zeros((B, 2, T, C, 2))
    base, moved = run_of_plans(scenes, plans, settings), run_of_plans(scenes, plans, settings)
    for b in range(B):
        item = item_of(scenes, plans, b, settings)
        if not acceptable(item):
            continue
        table = table_of(item, settings)
        start_motion(item, table, base.motion)
        if advance(item.world, base) == DONE:
            # Cutting steps elsewhere would look like a change of the motion.
            for i in range(len(base.motion.parts)):
                moved.motion.parts[i] = base.motion.parts[i]
            _differentiate(item, table, settings, adjoint[b], (base, moved), gradient[b])
    return gradient[:, POSITION], gradient[:, FORCE]


@compiled
def _differentiate(
    item: Item,
    table: Commands,
    settings: np.record,
    adjoint: np.ndarray,
    runs: tuple[Run, Run],
    gradient: np.ndarray,
) -> None:
    """Gradient (2, T, C, 2) of one item, given its run and memory for another one."""
    for which, t, c, d in np.ndindex(gradient.shape):
        # Idle fingers keep off the object by an offset that depends on where they are planned to be.
        bent = table.slope[t, c] != 0 or table.bend[t, c] != 0
        if which == FORCE and not bent and acts_alike(table, t, c):
            gradient[FORCE, t, c, d] = gradient[POSITION, t, c, d] / item.world.stiffness
            continue
        entry = (item.positions if which == POSITION else item.forces)[t, c]
        size = settings.difference_step * (1.0 if which == POSITION else item.world.stiffness)
        kept, total = entry[d], 0.0
        for sign in (1.0, -1.0):
            entry[d] = kept + sign * size
            changed = table_of(item, settings) if which == POSITION and bent else table
            total += sign * _change(item, changed, c, runs, settings.substeps, adjoint)
        entry[d] = kept
        gradient[which, t, c, d] = total / (2 * size)


@borrowing
def _change(
    item: Item, table: Commands, c: int, runs: tuple[Run, Run], substeps: int, adjoint: np.ndarray
) -> float:
    """Change of the knot poses along their adjoint (T, 3) for an item of which the plan of finger c was changed."""
    base, moved = runs
    first = _restart(item, table, c, base, moved)
    if first < len(moved.motion.parts):
        advance_alike(item.world, moved, first)
    total = 0.0
    for k in range(first // substeps + 1, len(adjoint)):
        for e in range(3):
            total += adjoint[k, e] * (
                moved.motion.poses[k * substeps, e] - base.motion.poses[k * substeps, e]
            )
    return total


@borrowing
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


@borrowing
def _restart(item: Item, table: Commands, c: int, base: Run, moved: Run) -> int:
    """Substep from which the changed commands of finger c act, with the state there copied from the unchanged motion.

    The number of substeps where they never do, because the finger is away from the object while they differ.
    """
    S, old, new = len(base.motion.parts), base.motion, moved.motion
    start_motion(item, table, new)
    first, last = 0, S
    if _same(new.fingers[0], old.fingers[0]) and _same(new.commands[0], old.commands[0]):
        while first < S and _same(old.commands[first + 1], new.commands[first + 1]):
            first += 1
    while last > first and _same(old.commands[last], new.commands[last]):
        last -= 1
    # A free finger, which has no mass, goes with its command: nothing is left of the change where that has none.
    near = False
    for i in range(first, min(last + 1, S)):
        near |= old.near[i, c]
    if not near:
        return S
    if first > 0:
        copy_state(old, first, new, first)
    return first


@borrowing
def _same(a: np.ndarray, b: np.ndarray) -> bool:
    """Whether all fingers are at the same places, (C, 2) each."""
    for c in range(len(a)):  # noqa: SIM110  (numba knows no generators here)
        if a[c, 0] != b[c, 0] or a[c, 1] != b[c, 1]:
            return False
    return True
