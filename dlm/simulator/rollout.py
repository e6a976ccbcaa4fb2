"""Whole motions: execution layer and time steps for one scene, and loops over batches.

Scenes are simulated one after the other by the same compiled code, so that a batch equals its single runs bit for bit.
"""

from typing import NamedTuple

import numpy as np

from dlm.simulator.commands import Commands, command
from dlm.simulator.execution import plan_commands
from dlm.simulator.kernels import borrowing, compiled
from dlm.simulator.problem import ROWS
from dlm.simulator.scene import SceneArrays
from dlm.simulator.step import Work, coasts, solve_step, work_for
from dlm.simulator.world import State, World, with_step, world_of

DONE, OVERFLOWN, UNSOLVED = 0, 1, 2
"""How a motion ends: as planned, with numbers that are not finite, with a contact problem that rounding made unsolvable."""
UNSOLVED_STEP = "simulation: the contact problem of a step was not solved"
HELD = 0.05
"""Share of a step's error that stays where contacts hold all three freedoms of the object, or its support brakes them."""
MOST_PARTS = 32
"""Of one step."""


class Plans(NamedTuple):
    """What B scenes are asked to do: positions and forces (B, T, C, 2), flags loaded (B, T, C), first poses start (B, 3)."""

    positions: np.ndarray
    forces: np.ndarray
    loaded: np.ndarray
    start: np.ndarray


class Motion(NamedTuple):
    """States at samples in time: poses and velocities (S + 1, 3), fingers and their commands (S + 1, C, 2).

    Of the steps between them: near (S, C): the finger was near enough to take part in the contact problem; parts (S,): into
    how many the step was cut.
    """

    poses: np.ndarray
    velocities: np.ndarray
    fingers: np.ndarray
    commands: np.ndarray
    near: np.ndarray
    parts: np.ndarray


class Run(NamedTuple):
    """Memory of one scene's execution: its motion at the substeps, at the parts of one of them, and scratch."""

    motion: Motion
    fine: Motion
    work: Work


class Item(NamedTuple):
    """One scene of a batch with its plan: desired path (T, 3), positions, forces (T, C, 2), loaded (T, C), start (3,)."""

    world: World
    path: np.ndarray
    positions: np.ndarray
    forces: np.ndarray
    loaded: np.ndarray
    start: np.ndarray


@compiled
def motion_for(samples: int, fingers: int) -> Motion:
    """Empty states."""
    return Motion(
        np.zeros((samples, 3)),
        np.zeros((samples, 3)),
        np.zeros((samples, fingers, 2)),
        np.zeros((samples, fingers, 2)),
        np.zeros((samples - 1, fingers), np.bool_),
        np.ones(samples - 1, np.int64),
    )


@compiled
def run_for(scenes: SceneArrays, samples: int, fingers: int) -> Run:
    """Memory for any scene of a batch."""
    work = work_for(fingers, scenes.walls.shape[1], scenes.facets.shape[1])
    return Run(motion_for(samples, fingers), motion_for(MOST_PARTS + 1, fingers), work)


@compiled
def run_of_plans(scenes: SceneArrays, plans: Plans, settings: np.record) -> Run:
    """Memory for any plan of a batch."""
    _, T, C = plans.loaded.shape
    return run_for(scenes, (T - 1) * settings.substeps + 1, C)


@compiled
def item_of(scenes: SceneArrays, plans: Plans, b: int, settings: np.record) -> Item:
    """Scene and plan b."""
    world, path = world_of(scenes, b, settings), scenes.path[b]
    return Item(world, path, plans.positions[b], plans.forces[b], plans.loaded[b], plans.start[b])


@compiled
def table_of(item: Item, settings: np.record) -> Commands:
    """How the commands depend on the plan."""
    return plan_commands(item.world, item.path, item.positions, item.loaded, settings)


@borrowing
def acceptable(item: Item) -> bool:
    """Whether a plan is made of finite numbers that leave room to compute with."""
    T, C = item.loaded.shape
    for t, c, d in np.ndindex((T, C, 2)):
        if not (abs(item.positions[t, c, d]) < 1e100 and abs(item.forces[t, c, d]) < 1e100):
            return False
    return True


@borrowing
def start_motion(item: Item, table: Commands, motion: Motion) -> None:
    """Commands of a plan, the object at rest at its first pose, and fingers where the plan has them."""
    command(table, item.positions, item.forces, item.world.stiffness, motion.commands)
    command(table, item.positions, item.forces, np.inf, motion.fingers[:1])
    for d in range(3):
        motion.poses[0, d], motion.velocities[0, d] = item.start[d], 0


@borrowing
def advance(world: World, run: Run) -> int:
    """Motion from its first state under its commands; DONE, or how it ended, with the last state held for good.

    Steps are cut into as many parts as their error asks for.
    """
    motion, _, work = run
    for i in range(len(motion.parts)):
        motion.near[i, :] = False
        motion.parts[i] = 1
        end, error = move(world, motion, i, motion.near[i], work)
        while error > world.step_error and motion.parts[i] < MOST_PARTS:
            motion.parts[i] = _enough_parts(motion.parts[i], error / world.step_error)
            end, error = move_in_parts(world, run, i)
        if end != DONE:
            hold(motion, i)
            return end
    return DONE


@borrowing
def advance_alike(world: World, run: Run, start: int) -> None:
    """The same from substep `start`, with steps cut into the parts that the motion has already."""
    motion, _, work = run
    for i in range(start, len(motion.parts)):
        motion.near[i, :] = False
        if motion.parts[i] == 1:
            end, _ = move(world, motion, i, motion.near[i], work)
        else:
            end, _ = move_in_parts(world, run, i)
        if end != DONE:
            hold(motion, i)
            return


@borrowing
def _enough_parts(parts: int, excess: float) -> int:
    """More parts than before, a power of two: the error falls with their number."""
    while excess > 1 and parts < MOST_PARTS:
        parts, excess = 2 * parts, excess / 2
    return parts


@borrowing
def move(world: World, motion: Motion, i: int, near: np.ndarray, work: Work) -> tuple[int, float]:
    """Step i in one go; how it ended, and an estimate of its error [m].  Sets flags near (C,) of fingers in contact problems.

    A coasting object is moved by the mean of both velocities: exact for gravity.  Otherwise the last one does, as the contact
    problem has it, and half the change of velocity is what the object may have moved wrongly.  Contacts that leave it no
    freedom put that right, and so does a support.
    """
    poses, velocities, fingers, commands, _, _ = motion
    velocity, finger_velocity, h = work.body[0].velocity, work.finger_velocity, world.h
    contacts = work.problem.contacts
    before = State(poses[i], velocities[i], fingers[i])
    n, exact = solve_step(world, before, commands[i : i + 2], work)
    coasting, held = coasts(n, world, before, work), 0
    for k in range(n):
        held += ROWS[contacts[k].state]
        if contacts[k].finger >= 0:
            near[contacts[k].finger] = True
    total, error = 0.0, 0.0
    for d in range(3):
        change = 0.5 * h * (velocity[d] - velocities[i, d])
        velocities[i + 1, d] = velocity[d]
        poses[i + 1, d] = poses[i, d] + h * velocity[d] - (change if coasting else 0.0)
        error = max(error, abs(change) * (world.gyration if d == 2 else 1.0))
        total += abs(poses[i + 1, d]) + abs(velocity[d])
    for c in range(len(near)):
        for d in range(2):
            fingers[i + 1, c, d] = fingers[i, c, d] + h * finger_velocity[c, d]
            total += abs(fingers[i + 1, c, d])
    if not np.isfinite(total):
        return OVERFLOWN, 0.0
    error *= 0.0 if coasting else (1.0 if held < 3 and world.support == 0 else HELD)
    return DONE if exact else UNSOLVED, error


@compiled
def move_in_parts(world: World, run: Run, i: int) -> tuple[int, float]:
    """Step i in as many parts as the motion says; how it ended, and an estimate of its error [m]."""
    motion, fine, work = run
    parts = motion.parts[i]
    finer, total = load_parts(world, run, i), 0.0
    for j in range(parts):
        end, error = move(finer, fine, j, motion.near[i], work)
        total += error
        if end != DONE:
            return end, total
    copy_state(fine, parts, motion, i + 1)
    return DONE, total


@compiled
def load_parts(world: World, run: Run, i: int) -> World:
    """State and commands of step i into the finer motion; the world whose step is one of its parts."""
    motion, fine, _ = run
    parts = motion.parts[i]
    copy_state(motion, i, fine, 0)
    for j in range(parts + 1):
        s = j / parts
        for c in range(fine.commands.shape[1]):
            for d in range(2):
                fine.commands[j, c, d] = (1 - s) * motion.commands[i, c, d] + s * motion.commands[i + 1, c, d]
    return with_step(world, world.h / parts)


@borrowing
def hold(motion: Motion, i: int) -> None:
    """State i for the rest of the motion."""
    for j in range(i + 1, len(motion.poses)):
        copy_state(motion, i, motion, j)


@borrowing
def copy_state(source: Motion, i: int, target: Motion, j: int) -> None:
    """State i of a motion becomes state j of another."""
    for d in range(3):
        target.poses[j, d], target.velocities[j, d] = source.poses[i, d], source.velocities[i, d]
    for c in range(source.fingers.shape[1]):
        target.fingers[j, c, 0], target.fingers[j, c, 1] = source.fingers[i, c, 0], source.fingers[i, c, 1]


@compiled(nogil=True)
def execute_batch(scenes: SceneArrays, plans: Plans, settings: np.record) -> tuple[np.ndarray, np.ndarray]:
    """Poses at the knots (B, T, 3), and how each motion ended (B,).

    A plan that is not finite leaves its object where it is, OVERFLOWN.
    """
    B, T, _ = plans.loaded.shape
    poses, ends = np.zeros((B, T, 3)), np.full(B, OVERFLOWN)
    run = run_of_plans(scenes, plans, settings)
    for b in range(B):
        item = item_of(scenes, plans, b, settings)
        for t, d in np.ndindex((T, 3)):
            poses[b, t, d] = item.start[d]
        if acceptable(item):
            start_motion(item, table_of(item, settings), run.motion)
            ends[b] = advance(item.world, run)
            for t, d in np.ndindex((T, 3)):
                poses[b, t, d] = run.motion.poses[t * settings.substeps, d]
    return poses, ends
