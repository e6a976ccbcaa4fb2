"""One plan, executed and recorded: poses, finger paths, contacts, energy, and how well each step kept the laws."""

from dataclasses import dataclass

import numpy as np
from numba import njit

from dlm.metrics import object_trajectory_loss, rotation_error, translation_error
from dlm.simulator.contact import View, view
from dlm.simulator.execution import command, desired_motion, plan_commands
from dlm.simulator.gradient import loaded_flags
from dlm.simulator.rollout import Motion, advance, motion_for, start_motion
from dlm.simulator.scene import Scene, SceneBatch
from dlm.simulator.settings import Physics, SimulatorSettings
from dlm.simulator.step import Work, solve_step, work_for
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
    friction cones and complementarity [N]; inexact: substeps whose contact problem was only approximated.
    ok: False where the motion overflowed and was held.
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
    inexact: int
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
    first pose, by default the desired one.  Raises InvalidProblem for plans of a wrong shape or with nan.
    """
    settings = settings or SimulatorSettings()
    commands, fingers = planned_commands(task, positions, forces, settings, contact=contact)
    batch = SceneBatch.of([task])
    scene, path = view(batch.arrays, 0), batch.desired[0]
    size = float(np.sqrt(scene.inertia / scene.mass))
    desired = desired_motion(path, scene.dt, size, settings.layers)
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
    flags = loaded_flags(batch, f[None])[0] if contact is None else np.array(contact, dtype=bool)
    require(flags.shape == p.shape[:2], "contact", f"shape {p.shape[:2]}", flags.shape)
    scene = view(batch.arrays, 0)
    table = plan_commands(scene, batch.desired[0], p, flags, settings.layers)
    commands = np.zeros((len(table.frame), p.shape[1], 2))
    command(table, p, f, scene.stiffness, commands)
    motion = motion_for(len(commands), p.shape[1])
    start_motion(table, p, f, motion)
    return commands, motion.fingers[0]


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
    scenes = batch.without_friction() if settings.frictionless else batch
    scene, physics = view(scenes.arrays, 0), settings.physics
    S, C = len(commands) - 1, commands.shape[1]
    motion, work = motion_for(S + 1, C), work_for(C, scenes.arrays.walls.shape[1])
    motion.poses[0], motion.fingers[0] = start, fingers
    motion.velocities[0] = 0 if velocity is None else velocity
    ok = advance(scene, physics, np.ascontiguousarray(commands, dtype=float), 0, motion, work)
    rows, laws, finger_work = _trace(scene, physics, commands, motion, work)
    v, q = motion.velocities, motion.poses
    energy = 0.5 * (scene.mass * (v[:, :2] ** 2).sum(1) + scene.inertia * v[:, 2] ** 2)
    return Replay(
        poses=q[:: settings.substeps].copy(),
        substep_poses=q,
        substep_velocities=v,
        desired=np.repeat(np.asarray(start)[None], S + 1, 0) if desired is None else desired,
        fingers=motion.fingers,
        commands=commands,
        contacts=_contacts(rows),
        energy=energy + scene.mass * scene.gravity * q[:, 1],
        work=finger_work,
        momentum_residual=float(laws[0]),
        cone_residual=float(laws[1]),
        inexact=int((~motion.exact).sum()),
        ok=bool(ok),
    )


def _contacts(rows: Array) -> ContactTrace:
    whole = rows[:, :3].astype(int)
    return ContactTrace(
        step=whole[:, 0],
        finger=whole[:, 1],
        wall=whole[:, 2],
        point=rows[:, 3:5],
        force=rows[:, 5:7],
        gap=rows[:, 7],
        slip=rows[:, 8],
    )


@njit(cache=True, error_model="numpy")
def _trace(
    scene: View, physics: Physics, commands: np.ndarray, motion: Motion, work: Work
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Contacts (n, 9) as in ContactTrace, the two residuals, work of the fingers (S,)."""
    S, h = len(commands) - 1, scene.dt / physics.substeps
    out, laws, finger_work = np.zeros((S * len(work.contacts), 9)), np.zeros(2), np.zeros(S)
    count = 0
    for i in range(S):
        q, v, p = motion.poses[i], motion.velocities[i], motion.fingers[i]
        n, _ = solve_step(scene, physics, q, v, p, commands[i + 1], work)
        _residuals(n, scene, physics, q, v, motion.velocities[i + 1], p, commands[i + 1], work, laws)
        for k in range(n):
            contact, normal, tangent = work.contacts[k], work.rows[2 * k], work.rows[2 * k + 1]
            if normal.P == 0 and tangent.P == 0:
                continue
            fx, fy = (
                (normal.P * normal.x + tangent.P * tangent.x) / h,
                (normal.P * normal.y + tangent.P * tangent.y) / h,
            )
            after, f = work.velocity, contact.finger
            slip = tangent.x * after[0] + tangent.y * after[1] + tangent.turn * after[2]
            if f >= 0:
                slip -= tangent.x * work.finger_velocity[f, 0] + tangent.y * work.finger_velocity[f, 1]
                turn = (normal.P * normal.turn + tangent.P * tangent.turn) / h
                mid = 0.5 * (v + after)
                finger_work[i] += h * (fx * mid[0] + fy * mid[1] + turn * mid[2])
            out[count, 0], out[count, 1], out[count, 2] = i, f, contact.wall
            out[count, 3], out[count, 4], out[count, 5], out[count, 6] = contact.x, contact.y, fx, fy
            out[count, 7], out[count, 8] = contact.gap, slip
            count += 1
    return out[:count], laws, finger_work


@njit(cache=True, error_model="numpy")
def _residuals(
    n: int,
    scene: View,
    physics: Physics,
    q: np.ndarray,
    v: np.ndarray,
    after: np.ndarray,
    p: np.ndarray,
    u: np.ndarray,
    work: Work,
    laws: np.ndarray,
) -> None:
    """Newton's law for object (support plane aside) and fingers, cones, signs and complementarity, all as forces."""
    h, size = scene.dt / physics.substeps, np.sqrt(scene.inertia / scene.mass)
    net = np.array(
        [
            scene.mass * (after[0] - v[0]),
            scene.mass * (after[1] - v[1] + h * scene.gravity),
            scene.inertia * (after[2] - v[2]),
        ]
    )
    spring = np.zeros_like(p)
    for c in range(len(p)):
        for d in range(2):
            drop = u[c, d] - p[c, d] - h * work.finger_velocity[c, d]
            spring[c, d] = scene.stiffness * drop - physics.damping * work.finger_velocity[c, d]
    for k in range(n):
        contact, normal, tangent = work.contacts[k], work.rows[2 * k], work.rows[2 * k + 1]
        fx, fy = normal.P * normal.x + tangent.P * tangent.x, normal.P * normal.y + tangent.P * tangent.y
        net[0] -= fx
        net[1] -= fy
        net[2] -= (contact.x - q[0]) * fy - (contact.y - q[1]) * fx
        if contact.finger >= 0:
            spring[contact.finger, 0] -= fx / h
            spring[contact.finger, 1] -= fy / h
        cone = max(-normal.P, abs(tangent.P) - contact.friction * normal.P)
        y = normal.c
        for s in range(2 * n):
            y += work.A[2 * k, s] * work.rows[s].P
        broken = abs(y) if normal.P > 0 else max(-y, 0.0)
        laws[1] = max(laws[1], cone / h, broken * scene.mass / h)
    if scene.support == 0:
        laws[0] = max(laws[0], abs(net[0]) / h, abs(net[1]) / h, abs(net[2]) / (h * size))
    if len(p) > 0:
        laws[0] = max(laws[0], np.abs(spring).max())
