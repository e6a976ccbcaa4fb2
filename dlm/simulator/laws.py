"""What a recorded motion did at every step: contacts and their forces, work of the fingers, and the laws of mechanics."""

import numpy as np

from dlm.simulator.kernels import borrowing, compiled
from dlm.simulator.modes import MOST_CONTACTS, has_other_solutions
from dlm.simulator.problem import relative_velocity
from dlm.simulator.rollout import Motion, Run, load_parts, move
from dlm.simulator.step import Work, solve_step
from dlm.simulator.world import State, World

TRACE = np.dtype(
    [(name, "i8") for name in ("step", "finger", "wall")]
    + [(name, "f8") for name in ("x", "y", "fx", "fy", "gap", "slip")]
)
"""A contact that carried force: substep, finger or -1, wall or -1, point, force on the object, gap before, slip after."""
LAWS = np.dtype([("momentum", "f8"), ("cone", "f8"), ("several", "i8"), ("unchecked", "i8")])
"""Largest violation of Newton's law, and of friction cones and complementarity [N]; steps whose contact problem has other
solutions too, and steps with too many contacts to look for them."""


@compiled
def trace(world: World, run: Run) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Contacts (n,) of TRACE, (1,) of LAWS, and work of the fingers (S,), of a motion that was run.

    Of a substep that was cut into parts, the contacts of the last one.
    """
    motion, fine, work = run
    S = len(motion.parts)
    out, laws = np.zeros(S * len(work.problem.contacts), TRACE), np.zeros(1, LAWS)
    finger_work = np.zeros(S)
    count = 0
    for i in range(S):
        finer = load_parts(world, run, i)
        for j in range(motion.parts[i]):
            move(finer, fine, j, motion.near[i], work)
            n, last = _check(finer, fine, j, work, laws[0]), j == motion.parts[i] - 1
            for k in range(n):
                if work.problem.rows[2 * k].P != 0 or work.problem.rows[2 * k + 1].P != 0:
                    out[count].step = i
                    finger_work[i] += _note_contact(k, finer, fine.velocities[j], work, out[count])
                    count += last
    return out[:count], laws, finger_work


@borrowing
def _check(world: World, motion: Motion, j: int, work: Work, laws: np.record) -> int:
    """Solve step j once more and hold it against the laws; the number of contacts."""
    before = State(motion.poses[j], motion.velocities[j], motion.fingers[j])
    commands = motion.commands[j : j + 2]
    n, _ = solve_step(world, before, commands, work)
    laws.momentum = max(laws.momentum, _momentum(n, world, before, commands, work))
    for k in range(n):
        laws.cone = max(laws.cone, _cone(n, k, world, work))
    if n > MOST_CONTACTS:
        laws.unchecked += 1
    elif n > 0 and has_other_solutions(n, work.problem):
        laws.several += 1
    return n


@borrowing
def _note_contact(k: int, world: World, before: np.ndarray, work: Work, out: np.record) -> float:
    """Fill the record of contact k; its finger's work on the object, whose velocity was `before`, during the step."""
    contact, f = work.problem.contacts[k], work.problem.contacts[k].finger
    normal, tangent = work.problem.rows[2 * k], work.problem.rows[2 * k + 1]
    out.finger, out.wall, out.gap, out.x, out.y = f, contact.wall, contact.gap, contact.x, contact.y
    out.fx = (normal.P * normal.x + tangent.P * tangent.x) / world.h
    out.fy = (normal.P * normal.y + tangent.P * tangent.y) / world.h
    after = work.body[0].velocity
    out.slip = tangent.x * after[0] + tangent.y * after[1] + tangent.turn * after[2]
    if f < 0:
        return 0.0
    out.slip -= tangent.x * work.finger_velocity[f, 0] + tangent.y * work.finger_velocity[f, 1]
    turn = (normal.P * normal.turn + tangent.P * tangent.turn) / world.h
    dx, dy, angle = before[0] + after[0], before[1] + after[1], before[2] + after[2]
    return world.h * (out.fx * (0.5 * dx) + out.fy * (0.5 * dy) + turn * (0.5 * angle))


@compiled
def _momentum(n: int, world: World, before: State, commands: np.ndarray, work: Work) -> float:
    """Violation of Newton's law for object (support plane aside) and fingers, moments over the radius of gyration [N]."""
    h, v, after, p = world.h, before.velocity, work.body[0].velocity, before.fingers
    net = np.array([after[0] - v[0], after[1] - v[1] + h * world.gravity, after[2] - v[2]])
    net *= np.array([world.mass, world.mass, world.inertia])
    spring = np.zeros_like(p)
    for c in range(len(p)):
        for d in range(2):
            u, target, w = commands[0, c, d], commands[1, c, d], work.finger_velocity[c, d]
            spring[c, d] = world.stiffness * (target - p[c, d] - h * w) + world.damping * (
                (target - u) / h - w
            )
    for k in range(n):
        contact, normal, tangent = (
            work.problem.contacts[k],
            work.problem.rows[2 * k],
            work.problem.rows[2 * k + 1],
        )
        fx, fy = normal.P * normal.x + tangent.P * tangent.x, normal.P * normal.y + tangent.P * tangent.y
        net[0] -= fx
        net[1] -= fy
        net[2] -= (contact.x - before.pose[0]) * fy - (contact.y - before.pose[1]) * fx
        if contact.finger >= 0:
            spring[contact.finger, 0] -= fx / h
            spring[contact.finger, 1] -= fy / h
    net[2] /= world.gyration
    largest = np.abs(spring).max() if len(p) > 0 else 0.0
    return largest if world.support > 0 else max(largest, np.abs(net).max() / h)


@borrowing
def _cone(n: int, k: int, world: World, work: Work) -> float:
    """Violation of signs, friction cone and complementarity by contact k, as a force [N]."""
    normal, tangent = work.problem.rows[2 * k].P, work.problem.rows[2 * k + 1].P
    cone = max(-normal, abs(tangent) - work.problem.contacts[k].friction * normal)
    y = relative_velocity(n, work.problem, 2 * k)
    broken = abs(y) if normal > 0 else max(-y, 0.0)
    return max(cone, broken * world.mass) / world.h
