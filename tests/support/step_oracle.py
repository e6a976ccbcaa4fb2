"""One time step of the simulator written down a second time, in plain numpy: the contact problem of a convex object.

Follows docs/theory/simulator.md and shares no code with `dlm.simulator`: all vertices near a wall, fingers by shapely.
"""

from dataclasses import dataclass

import numpy as np
import shapely

from dlm.simulator import Scene
from expert.geometry.pose import Array, to_world
from expert.world.environment import Environment
from expert.world.motion import Trajectory
from expert.world.shape import Body
from expert.world.walls import HalfPlane
from tests.support.contact_modes import ContactProblem

REACH, SHALLOW, CORRECTION, FASTEST = 2e-3, 1e-5, 0.2, 0.5
REGULARIZATION, RADIUS, CRITICAL = 1e-4, 1e-4, 1.0


@dataclass(frozen=True)
class Step:
    """Start of a step: pose, velocity (3,), fingers (C, 2), their commands at its begin and end (2, C, 2), duration h."""

    scene: Scene
    pose: Array
    velocity: Array
    fingers: Array
    commands: Array
    h: float


@dataclass(frozen=True)
class Contact:
    """Direction n of the force on the object, point, gap, friction; finger or -1."""

    n: Array
    point: Array
    gap: float
    friction: float
    finger: int = -1


def velocities(step: Step) -> list[Array]:
    """The object's velocity (3,) after the step, for every solution of its contact problem."""
    body, contacts = step.scene.body, near(step)
    inverse = np.diag([1 / body.mass, 1 / body.mass, 1 / body.inertia])
    if not contacts:
        return [free(step)]
    jacobian = np.array([rows(c, step.pose) for c in contacts])
    problem = contact_problem(step, contacts, jacobian)
    return [free(step) + inverse @ np.einsum("kdi,kd->i", jacobian, P) for P in problem.solutions()]


def free(step: Step) -> Array:
    e = step.scene.environment
    return step.velocity - [0, step.h * e.gravity * (e.plane == "sagittal"), 0]


def spring(step: Step) -> tuple[Array, float]:
    """Velocities of the fingers without contact (C, 2), and velocity per impulse."""
    k, h = step.scene.stiffness, step.h
    d = CRITICAL * 2 * np.sqrt(k * step.scene.body.mass)
    begin, end = step.commands
    return (k * (end - step.fingers) + d * (end - begin) / h) / (k * h + d), 1 / (h * (k * h + d))


def near(step: Step) -> list[Contact]:
    """Contacts that the motion without impulses would leave closer than REACH."""
    found = []
    for wall in step.scene.environment.walls:
        for vertex in to_world(step.pose, step.scene.body.vertices):
            found.append(
                Contact(wall.normal, vertex, float((vertex - wall.point) @ wall.normal), wall.friction)
            )
    outline = shapely.Polygon(to_world(step.pose, step.scene.body.vertices))
    for c, finger in enumerate(step.fingers):
        point = np.array(
            outline.exterior.interpolate(outline.exterior.project(shapely.Point(finger))).coords[0]
        )
        inside = -1.0 if outline.contains(shapely.Point(finger)) else 1.0
        distance = inside * float(np.linalg.norm(finger - point))
        found.append(Contact((point - finger) / distance, point, distance - RADIUS, step.scene.friction, c))
    moving, (fingers, _) = free(step), spring(step)
    return [c for c in found if c.gap + step.h * approach(c, step.pose, moving, fingers)[0] < REACH]


def rows(contact: Contact, pose: Array) -> Array:
    """Contact Jacobian (2, 3): normal and the normal turned by 90 degrees."""
    arm, n = contact.point - pose[:2], contact.n
    t = np.array([-n[1], n[0]])
    return np.array([[*d, arm[0] * d[1] - arm[1] * d[0]] for d in (n, t)])


def approach(contact: Contact, pose: Array, velocity: Array, fingers: Array) -> Array:
    """Relative velocity (2,)."""
    n, t = contact.n, np.array([-contact.n[1], contact.n[0]])
    other = np.zeros(2) if contact.finger < 0 else fingers[contact.finger]
    return rows(contact, pose) @ velocity - [n @ other, t @ other]


def contact_problem(step: Step, contacts: list[Contact], jacobian: Array) -> ContactProblem:
    body, (fingers, give) = step.scene.body, spring(step)
    inverse = np.diag([1 / body.mass, 1 / body.mass, 1 / body.inertia])
    A = np.einsum("kdi,ij,lej->kdle", jacobian, inverse, jacobian)
    c = np.array([approach(contact, step.pose, free(step), fingers) for contact in contacts])
    for k, contact in enumerate(contacts):
        touches = contact.finger >= 0
        for d in range(2):
            lever = jacobian[k, d, 2]
            A[k, d, k, d] += give * touches
            scale = 1 / body.mass + lever**2 / body.inertia + give * touches
            A[k, d, k, d] += REGULARIZATION * scale
        gap = contact.gap
        deep = max((CORRECTION * (gap + SHALLOW) - SHALLOW) / step.h, -FASTEST)
        c[k, 0] += deep if gap < -SHALLOW else gap / step.h
    return ContactProblem(A, c, np.array([contact.friction for contact in contacts]))


def random_step(rng: np.random.Generator) -> Step:
    """A convex object near or in floor and wall, fingers on or near it, friction 0 to 3, any velocity."""
    hull = shapely.MultiPoint(0.03 * rng.normal(size=(int(rng.integers(3, 7)), 2))).convex_hull
    body, _ = Body.uniform(
        shapely.geometry.polygon.orient(hull).exterior.coords[:-1], 10 ** rng.uniform(-2, 0.5)
    )
    angle = rng.uniform(-np.pi, np.pi)
    vertices = to_world([0, 0, angle], body.vertices)
    sunk = float(rng.choice([0, 5e-6, -1e-4, 1e-3, -1e-2]))
    pose = np.array([0.0, -vertices[:, 1].min() - sunk, angle])
    walls = [HalfPlane(point=np.zeros(2), normal=np.array([0.0, 1.0]), friction=rng.uniform(0, 3))]
    if rng.random() < 0.3:
        point = np.array([vertices[:, 0].min() + rng.choice([0, 1e-4]), 0])
        walls.append(HalfPlane(point=point, normal=np.array([1.0, 0.0]), friction=rng.uniform(0, 3)))
    scene = Scene(
        body=body,
        environment=Environment(walls=tuple(walls)),
        trajectory=Trajectory.of(np.tile(pose, (3, 1)), 0.1, "rest"),
        friction=rng.uniform(0, 3),
    )
    outline = shapely.Polygon(to_world(pose, body.vertices)).exterior
    fingers = np.zeros((int(rng.integers(0, 3)), 2))
    for finger in fingers:
        s = rng.uniform(0, outline.length)
        point, ahead = (np.array(outline.interpolate(x).coords[0]) for x in (s, s + 1e-6))
        outward = np.array([ahead[1] - point[1], point[0] - ahead[0]]) / np.linalg.norm(ahead - point)
        finger[:] = point + (RADIUS + rng.choice([0, 1e-5, -5e-6, 3e-4])) * outward
    push = 2 * body.mass * 9.81 / scene.stiffness
    first = fingers + push * rng.normal(size=fingers.shape)
    commands = np.stack([first, first + 0.3 * push * rng.normal(size=fingers.shape)])
    return Step(scene, pose, rng.normal(0, [0.3, 0.3, 3]), fingers, commands, 0.005)
