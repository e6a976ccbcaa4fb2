"""Contacts of the object with walls and support, read from its motion, and what they leave for fingers to do (3-CT6)."""

from dataclasses import dataclass

import numpy as np

from expert.geometry.pose import Array, perpendicular, to_world
from expert.mechanics.wrenches import friction_rays, inertial_wrench, wrench_about
from expert.problems.contact import SUPPORT, ContactTask
from expert.world.values import IntArray

SUPPORT_RAYS = 8


@dataclass(frozen=True)
class ExternalContact:
    """Contact of object vertex `vertex` with wall `wall` (SUPPORT: support plane) at step `step`.

    The environment can exert sum_k w_k rays[k] [N] at `point` [m] with w >= 0 and sum w <= limit;
    where `fixed`, sliding friction on the support leaves no choice: the force is rays[0].
    For walls, rays have unit normal component, so that sum w is the normal force [N].
    """

    step: int
    vertex: int
    wall: int
    point: Array
    rays: Array
    limit: float
    fixed: bool = False


def required_wrench(task: ContactTask, contacts: tuple[ExternalContact, ...]) -> Array:
    """What fingers and undetermined environment forces must exert about the centre of mass, (T, 3) [N, N, N m]."""
    wrench = inertial_wrench(task)
    for c in contacts:
        if c.fixed:
            wrench[c.step] -= wrench_about(c.rays[0], c.point, task.trajectory.poses[c.step, :2])
    return wrench


def reaction_limit(task: ContactTask) -> float:
    """Explicit bound on any wall's normal force [N]: ten times all that fingers, weight and inertia can add up to."""
    inertial = np.abs(inertial_wrench(task)[:, :2]).sum(axis=1).max()
    fingers = task.fingers.count * task.fingers.max_force * (1 + task.fingers.friction)
    return 10 * float(task.weight + inertial + fingers)


def external_contacts(task: ContactTask) -> tuple[ExternalContact, ...]:
    """Every contact of the object with its environment, modes read from the finite displacement to the next pose.

    Leaving: no force.  Staying put: the whole cone.  Sliding: the one edge that opposes the motion.  (Thesis 3-CT6)
    """
    vertices = to_world(task.trajectory.extended[1:], task.body.vertices)  # (T + 1, V, 2)
    contacts = _wall_contacts(task, vertices)
    if task.environment.plane == "transverse":
        contacts += _support_contacts(task, vertices)
    return tuple(sorted(contacts, key=lambda c: (c.step, c.wall, c.vertex)))


def _wall_contacts(task: ContactTask, vertices: Array) -> list[ExternalContact]:
    tolerance, limit = task.contact_tolerance, reaction_limit(task)
    contacts = []
    for k, wall in enumerate(task.environment.walls):
        gap = wall.gap(vertices)  # (T + 1, V)
        touching = (gap[:-1] <= tolerance) & (gap[1:] <= tolerance)
        tangent = -perpendicular(wall.normal)
        for t in np.flatnonzero(touching.any(axis=1)):
            for v, point in _line_contact(task, vertices[t], np.flatnonzero(touching[t]), tangent):
                slip = float((vertices[t + 1, v] - vertices[t, v]) @ tangent)
                rays = _wall_cone(wall.normal, wall.friction, slip, tolerance, task.robustness.cone_fraction)
                contacts.append(ExternalContact(int(t), v, k, point, rays, limit))
    return contacts


def _wall_cone(normal: Array, friction: float, slip: float, tolerance: float, cone_fraction: float) -> Array:
    """Admissible rays; a sliding contact keeps its full friction, since its force sits on the edge."""
    if abs(slip) <= tolerance:
        return friction_rays(normal, cone_fraction * friction)
    plus, minus = friction_rays(normal, friction)
    return (minus if slip > 0 else plus)[None]


def _line_contact(
    task: ContactTask, vertices: Array, touching: IntArray, tangent: Array
) -> list[tuple[int, Array]]:
    """The extreme touching vertices, drawn in by support_inset of their distance; a single one stays."""
    along = vertices[touching] @ tangent
    first, last = int(touching[along.argmin()]), int(touching[along.argmax()])
    if first == last:
        return [(first, vertices[first])]
    inset = task.robustness.support_inset * (vertices[last] - vertices[first])
    return [(first, vertices[first] + inset), (last, vertices[last] - inset)]


def _support_contacts(task: ContactTask, vertices: Array) -> list[ExternalContact]:
    """Support friction mu N on each vertex, N = m g / V: opposes motion, or any force in an octagon of the disc at rest."""
    count = len(task.body.vertices)
    disc = task.environment.support_friction * task.weight / count
    angles = 2 * np.pi * np.arange(SUPPORT_RAYS) / SUPPORT_RAYS
    octagon = disc * np.column_stack([np.cos(angles), np.sin(angles)])
    contacts = []
    for t in range(task.steps):
        motion = vertices[t + 1] - vertices[t]
        speed = np.linalg.norm(motion, axis=1)
        for v in range(count):
            fixed = bool(speed[v] > task.contact_tolerance)
            rays = -disc * motion[v][None] / speed[v] if fixed else octagon
            contacts.append(ExternalContact(t, v, SUPPORT, vertices[t, v], rays, 1.0, fixed))
    return contacts
