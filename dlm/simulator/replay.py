"""One plan, executed and recorded: poses, finger paths, contacts, energy, and how well each step kept the laws."""

from dataclasses import dataclass

import numpy as np

from dlm.metrics import object_trajectory_loss, rotation_error, translation_error
from dlm.simulator.laws import trace
from dlm.simulator.path import desired_motion
from dlm.simulator.rollout import (
    DONE,
    UNSOLVED,
    UNSOLVED_STEP,
    Motion,
    Plans,
    Run,
    advance,
    item_of,
    run_for,
    run_of_plans,
    start_motion,
    table_of,
)
from dlm.simulator.scene import Scene, SceneBatch
from dlm.simulator.settings import SimulatorSettings
from dlm.simulator.world import World, world_of
from expert.errors import SolverFailed
from expert.geometry.pose import Array
from expert.problems.contact import ContactTask
from expert.world.values import readonly, require


@dataclass(frozen=True, kw_only=True)
class ContactTrace:
    """Contacts that carried force, one row each, sorted by step.

    step: substep (S,) counted from 0; finger: index or -1; wall: index or -1; point [m], force [N on the object] (n, 2);
    gap [m] before the step; slip: tangential velocity after it [m/s].
    """

    step: np.ndarray
    finger: np.ndarray
    wall: np.ndarray
    point: Array
    force: Array
    gap: Array
    slip: Array


@dataclass(frozen=True, kw_only=True)
class Replay:
    """Record of one execution, T knots, S substeps, C fingers.

    poses (T, 3) at the knots; substep_poses, substep_velocities, desired (S + 1, 3); fingers, commands (S + 1, C, 2) [m].
    energy (S + 1,): kinetic plus potential energy of the object [J]; work (S,): of the fingers on it per substep [J].
    momentum_residual, cone_residual: largest violation of Newton's law [N, with moments over the object's size] and of
    friction cones and complementarity [N].  several: steps whose contact problem has other solutions too (Painleve); this
    is looked for with up to four contacts, and not in `unchecked` steps.  ok: False where numbers overflowed and the motion
    was held.
    """

    poses: Array
    substep_poses: Array
    substep_velocities: Array
    desired: Array
    fingers: Array
    commands: Array
    contacts: ContactTrace
    energy: Array
    work: Array
    momentum_residual: float
    cone_residual: float
    several: int
    unchecked: int
    ok: bool

    @property
    def loss(self) -> float:
        """Against the desired poses at the knots [cm^2]."""
        step = (len(self.desired) - 1) // (len(self.poses) - 1)
        return float(object_trajectory_loss(self.poses, self.desired[::step]))

    @property
    def final_error(self) -> tuple[float, float]:
        """Of the last pose [mm], [deg]."""
        last, goal = self.poses[-1], self.desired[-1]
        return float(translation_error(last, goal)), float(rotation_error(last, goal))


def replay(
    task: ContactTask | Scene,
    positions: Array,
    forces: Array,
    settings: SimulatorSettings | None = None,
    *,
    contact: np.ndarray | None = None,
    start: Array | None = None,
) -> Replay:
    """Execute one plan, positions [m] and forces [N] (T, C, 2), and record it.

    contact (T, C): the finger pushes from this knot on; by default where its force is not zero.  start (3,): the object's
    first pose, by default the desired one.  Raises InvalidProblem for plans of a wrong shape or with nan, SolverFailed where rounding
    made a contact problem unsolvable.
    """
    settings = settings or SimulatorSettings()
    commands, fingers = planned_commands(task, positions, forces, settings, contact=contact)
    batch = SceneBatch.of([task])
    path, arrays = batch.desired[0], batch.arrays
    size = float(np.sqrt(arrays.inertia[0] / arrays.mass[0]))
    desired = desired_motion(path, size, settings.numbers)
    first = path[0] if start is None else readonly(start, (3,), "start")
    return simulate(batch, commands, first, fingers, settings, desired=desired)


def planned_commands(
    task: ContactTask | Scene,
    positions: Array,
    forces: Array,
    settings: SimulatorSettings,
    *,
    contact: np.ndarray | None = None,
) -> tuple[Array, Array]:
    """What the execution layer makes of a plan: commands (S + 1, C, 2) and the fingers' first positions (C, 2) [m]."""
    batch = SceneBatch.of([task])
    p = readonly(positions, (batch.steps, None, 2), "positions").copy()
    f = readonly(forces, (*p.shape[:2], 2), "forces").copy()
    flags = batch.loaded(f[None])[0] if contact is None else np.array(contact, dtype=bool)
    require(flags.shape == p.shape[:2], "contact", f"shape {p.shape[:2]}", flags.shape)
    plans = Plans(p[None], f[None], np.ascontiguousarray(flags[None]), batch.desired[:, 0].copy())
    numbers = settings.numbers
    run, item = run_of_plans(batch.arrays, plans, numbers), item_of(batch.arrays, plans, 0, numbers)
    table = table_of(item, numbers)
    start_motion(item, table, run.motion)
    return run.motion.commands, run.motion.fingers[0]


def simulate(
    batch: SceneBatch,
    commands: Array,
    start: Array,
    fingers: Array,
    settings: SimulatorSettings,
    *,
    velocity: Array | None = None,
    desired: Array | None = None,
) -> Replay:
    """Record the first scene of a batch under given commands (S + 1, C, 2), without any execution layer.

    start (3,) pose, velocity (3,) by default 0, fingers (C, 2) first positions.  S is a multiple of the substeps.
    """
    scenes = (batch.without_friction() if settings.frictionless else batch).arrays
    world = world_of(scenes, 0, settings.numbers)
    run = run_for(scenes, *commands.shape[:2])
    motion = run.motion
    motion.commands[:] = commands
    motion.poses[0], motion.fingers[0] = start, fingers
    motion.velocities[0] = 0 if velocity is None else velocity
    ok = follow(world, run)
    contacts, laws, finger_work = trace(world, run)
    q, v = motion.poses, motion.velocities
    return Replay(
        poses=q[:: settings.substeps].copy(),
        substep_poses=q,
        substep_velocities=v,
        desired=np.repeat(np.asarray(start)[None], len(q), 0) if desired is None else desired,
        fingers=motion.fingers,
        commands=commands,
        contacts=_contacts(contacts),
        energy=_energy(world, motion),
        work=finger_work,
        momentum_residual=float(laws["momentum"][0]),
        cone_residual=float(laws["cone"][0]),
        several=int(laws["several"][0]),
        unchecked=int(laws["unchecked"][0]),
        ok=ok,
    )


def follow(world: World, run: Run) -> bool:
    """Run a motion from its first state under its commands; whether numbers stayed finite.

    Raises SolverFailed where rounding made a contact problem unsolvable.
    """
    end = advance(world, run)
    if end == UNSOLVED:
        raise SolverFailed(UNSOLVED_STEP)
    return end == DONE


def _energy(world: World, motion: Motion) -> Array:
    """Kinetic plus potential energy of the object (S + 1,) [J]."""
    v = motion.velocities
    kinetic = 0.5 * (world.mass * (v[:, :2] ** 2).sum(1) + world.inertia * v[:, 2] ** 2)
    return kinetic + world.mass * world.gravity * motion.poses[:, 1]


def _contacts(rows: np.ndarray) -> ContactTrace:
    return ContactTrace(
        step=rows["step"],
        finger=rows["finger"],
        wall=rows["wall"],
        point=np.column_stack([rows["x"], rows["y"]]),
        force=np.column_stack([rows["fx"], rows["fy"]]),
        gap=rows["gap"],
        slip=rows["slip"],
    )
