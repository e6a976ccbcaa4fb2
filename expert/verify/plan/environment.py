"""What walls and support do in a plan: Coulomb's law read from the motion of material points (Thesis 3-CT6)."""

import numpy as np

from expert.geometry.pose import Array, perpendicular, to_body, to_world
from expert.problems.contact import SUPPORT, ContactForce, ContactTask, Plan
from expert.verify.plan.report import Check
from expert.world.walls import HalfPlane


def environment_checks(task: ContactTask, plan: Plan, force: float, length: float) -> tuple[Check, ...]:
    """Walls push only where the object stays in touch with them, within their cones; the support drags (3-CT6)."""
    on_walls = [c for c in plan.contact_forces if c.wall != SUPPORT]
    places = [_wall_distance(task, c) / task.body.size for c in on_walls]
    cones = [_outside_wall_cone(task, c) / task.weight for c in on_walls]
    axes = ("contact force",)
    return (
        Check.largest("environment_contact", places, 2 * task.contact_tolerance / task.body.size, "L", axes),
        Check.largest("environment_cone", cones, force, "m g", axes),
        *_support(task, plan, force, length),
    )


def _displacement(task: ContactTask, step: int, point: Array) -> Array:
    """How far the object's material point at `point` moves until the next pose, (2,) [m]."""
    now, later = task.trajectory.extended[step + 1], task.trajectory.extended[step + 2]
    return to_world(later, to_body(now, point[None]))[0] - point


def _wall_distance(task: ContactTask, contact: ContactForce) -> float:
    """How far [m] the force is from the stretch of wall where the object rests now and at the next pose, and from its vertex.

    The vertex that it names is one that rests there, drawn in by no more than the inset.
    """
    wall, touching = task.environment.walls[contact.wall], _touching(task, contact)
    if not len(touching):
        return np.inf
    tangent = perpendicular(wall.normal)
    along = touching @ tangent
    inset = task.robustness.support_inset * np.ptp(along)
    s = float(contact.point @ tangent)
    beyond = max(along.min() + inset - s, s - along.max() + inset)
    vertex = to_world(task.trajectory.poses[contact.step], task.body.vertices)[contact.vertex]
    astray = float(np.linalg.norm(contact.point - vertex)) - inset
    return max(float(beyond), abs(float(wall.gap(contact.point))), astray)


def _touching(task: ContactTask, contact: ContactForce) -> Array:
    """Object vertices (n, 2) that touch the wall at the step and still do at the next pose, at the step."""
    wall, extended = task.environment.walls[contact.wall], task.trajectory.extended[contact.step + 1 :][:2]
    vertices = to_world(extended, task.body.vertices)
    return vertices[0][(wall.gap(vertices) <= task.contact_tolerance).all(axis=0)]


def _outside_wall_cone(task: ContactTask, contact: ContactForce) -> float:
    """Distance [N] of a wall's force from what Coulomb allows: a cone at rest, its edge against the motion in sliding."""
    wall: HalfPlane = task.environment.walls[contact.wall]
    tangent = perpendicular(wall.normal)
    normal, tangential = float(contact.force @ wall.normal), float(contact.force @ tangent)
    slip = float(_displacement(task, contact.step, contact.point) @ tangent)
    if abs(slip) > task.contact_tolerance:
        return max(-normal, abs(tangential + np.sign(slip) * wall.friction * normal))
    return max(-normal, abs(tangential) - task.robustness.cone_fraction * wall.friction * normal)


def _support(task: ContactTask, plan: Plan, force: float, length: float) -> tuple[Check, ...]:
    """Each vertex bears m g / V: friction mu N against its motion, any force up to mu N at rest; in the sagittal plane none."""
    vertices = to_world(task.trajectory.poses, task.body.vertices)
    total, misplaced = np.zeros_like(vertices), np.zeros(vertices.shape[:2])
    for c in plan.contact_forces:
        if c.wall == SUPPORT:
            total[c.step, c.vertex] += c.force
            distance = float(np.linalg.norm(c.point - vertices[c.step, c.vertex]))
            misplaced[c.step, c.vertex] = max(misplaced[c.step, c.vertex], distance)
    transverse = task.environment.plane == "transverse"
    disc = task.environment.support_friction * task.weight / len(task.body.vertices) if transverse else 0.0
    motion = to_world(task.trajectory.extended[2:], task.body.vertices) - vertices
    speed = np.linalg.norm(motion, axis=2)
    slides = speed > task.contact_tolerance
    drag = -disc * motion / np.where(slides, speed, 1.0)[..., None]
    off_edge = np.linalg.norm(total - drag, axis=2)
    off_disc = np.linalg.norm(total, axis=2) - disc
    axes = ("step", "vertex")
    return (
        Check.largest(
            "support_friction", np.where(slides, off_edge, off_disc) / task.weight, force, "m g", axes
        ),
        Check.largest("support_contact", misplaced / task.body.size, length, "L", axes),
    )
