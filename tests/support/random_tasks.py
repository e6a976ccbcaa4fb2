"""Random small tasks in both planes, from nothing but a seed."""

import numpy as np
import shapely

from expert.geometry.pose import Array, to_world
from expert.problems.contact import ContactTask, Cost, Robustness
from expert.world.environment import Environment
from expert.world.fingers import Fingers
from expert.world.motion import Trajectory
from expert.world.shape import Body
from expert.world.walls import HalfPlane

MASS, GRAVITY = 0.1, 9.81


def random_body(rng: np.random.Generator, facets: int) -> Body:
    """Convex polygon of 6 to 10 cm with no very short side, resting on facet 0 (which is level, below)."""
    while True:
        angles = np.sort(rng.uniform(0, 2 * np.pi, facets))
        corners = np.column_stack([np.cos(angles), rng.uniform(0.6, 1.0) * np.sin(angles)])
        sides = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
        hull = shapely.MultiPoint(corners).convex_hull
        if sides.min() > 0.6 and hull.area > 0.8:
            break
    base = corners[1] - corners[0]
    turned = to_world([0, 0, -np.arctan2(base[1], base[0])], corners)
    body, _ = Body.uniform(turned * rng.uniform(0.03, 0.05), MASS)
    return body


def floor_task(
    rng: np.random.Generator,
    *,
    facets: int = 4,
    steps: int = 4,
    fingers: int = 2,
    friction: float = 0.5,
    robustness: Robustness | None = None,
    margin: float = 0.0,
) -> ContactTask:
    """Slide, tilt or lift, rest to rest, over a floor."""
    while True:
        body = random_body(rng, facets)
        height = -body.vertices[:, 1].min()
        left, right = body.vertices[0], body.vertices[1]
        if left[0] < -0.005 and right[0] > 0.005:  # it stands
            break
    s = np.linspace(0, 1, steps)
    s = s * s * (3 - 2 * s)
    kind = rng.choice(["slide", "tilt", "lift"])
    poses = np.tile([0.0, height, 0.0], (steps, 1))
    if kind == "slide":
        poses[:, 0] += s * rng.choice([-1, 1]) * rng.uniform(0.01, 0.03)
    elif kind == "lift":
        poses += s[:, None] * [rng.uniform(-0.02, 0.02), rng.uniform(0.01, 0.03), rng.uniform(-0.3, 0.3)]
        poses[:, 1] += lowest_gap(body, poses)
    else:
        poses = tilted(body, poses, s * rng.uniform(0.1, 0.4))
    return ContactTask(
        body=body,
        environment=Environment(
            gravity=GRAVITY,
            walls=(HalfPlane(point=np.zeros(2), normal=np.array([0.0, 1.0]), friction=friction),),
        ),
        trajectory=Trajectory.of(poses, 0.1, "rest"),
        fingers=Fingers(count=fingers, friction=friction, max_force=10 * MASS * GRAVITY),
        cost=Cost(margin=margin),
        robustness=robustness or Robustness(),
    )


def lowest_gap(body: Body, poses: Array) -> Array:
    """How far each pose must be raised to stay out of the floor."""
    return np.maximum(0.0, -to_world(poses, body.vertices)[..., 1].min(axis=1))


def tilted(body: Body, poses: Array, angles: Array) -> Array:
    """Counter-clockwise about the left end of the base."""
    pivot = poses[0, :2] + body.vertices[0]
    arm = -body.vertices[0]
    turned = np.stack(
        [
            np.cos(angles) * arm[0] - np.sin(angles) * arm[1],
            np.sin(angles) * arm[0] + np.cos(angles) * arm[1],
        ],
        -1,
    )
    return np.column_stack([pivot + turned, angles])


def table_task(rng: np.random.Generator, *, facets: int = 4, steps: int = 4, fingers: int = 2) -> ContactTask:
    """Slide and turn at constant velocity on a support."""
    body = random_body(rng, facets)
    velocity = np.array([*rng.uniform(-0.1, 0.1, 2), rng.uniform(-1.0, 1.0)])
    return ContactTask(
        body=body,
        environment=Environment(plane="transverse", gravity=GRAVITY, support_friction=0.3),
        trajectory=Trajectory.of(0.1 * np.arange(steps)[:, None] * velocity, 0.1),
        fingers=Fingers(count=fingers, friction=0.4, max_force=10 * MASS * GRAVITY),
    )
