"""What a plan costs, by how much it misses Newton-Euler, and what the environment exerts: from the plan itself."""

import numpy as np

from expert.geometry.pose import Array
from expert.mechanics import external_contacts, inertial_wrench, wrench_about
from expert.problems.contact import FREE, SUPPORT, ContactForce, ContactTask
from expert.world.values import IntArray


def contact_forces(task: ContactTask, weights: Array) -> tuple[ContactForce, ...]:
    """Forces of walls and support from the weights (T, E) [m g] of the environment's rays, and those that sliding fixes."""
    forces, used = [], np.zeros(task.steps, dtype=int)
    for c in external_contacts(task):
        force = c.rays[0]
        if not c.fixed:
            first = used[c.step]
            used[c.step] += len(c.rays)
            unit = (
                1.0 if c.wall == SUPPORT else task.weight
            )  # rays of the support are forces, those of walls directions
            force = unit * np.maximum(weights[c.step, first : used[c.step]], 0.0) @ c.rays
        if force.any():
            forces.append(ContactForce(step=c.step, vertex=c.vertex, wall=c.wall, point=c.point, force=force))
    return tuple(forces)


def plan_cost(task: ContactTask, modes: IntArray, positions: Array, forces: Array) -> float:
    """The thesis's J = sum |lambda|^2 + |p_ddot|^2 - beta, p_ddot by backward differences from the third step on."""
    acceleration = np.diff(positions, n=2, axis=0) / task.trajectory.dt**2
    cost = task.cost.force * np.sum(forces**2) + task.cost.acceleration * np.sum(acceleration**2)
    if task.cost.margin == 0:
        return float(cost)
    normal, tangent = task.body.frames_w(task.trajectory.poses)
    facet, step = np.maximum(modes, 0), np.arange(task.steps)[:, None]
    lam_n, lam_t = (np.sum(forces * frame[step, facet], axis=2) for frame in (normal, tangent))
    mu = task.fingers.friction
    beta = (mu * lam_n - np.abs(lam_t)) / np.hypot(1, mu)
    return float(cost - task.cost.margin * np.sum(beta[modes != FREE]))


def wrench_residual(
    task: ContactTask, positions: Array, forces: Array, contact_forces: tuple[ContactForce, ...]
) -> float:
    """Largest violation of Newton-Euler over m g and m g L, with the true torque (p - q) x lambda."""
    centres = task.trajectory.poses[:, :2]
    wrench = wrench_about(forces, positions, centres[:, None]).sum(axis=1) - inertial_wrench(task)
    for c in contact_forces:
        wrench[c.step] += wrench_about(c.force, c.point, centres[c.step])
    return float(np.abs(wrench / [task.weight, task.weight, task.weight * task.body.size]).max())
