"""Contact tasks with a plan by construction: forces first, then the motion that they make."""

import numpy as np

from expert.geometry.polygon import facet_frames, facets
from expert.geometry.pose import cross, rotation
from expert.problems.contact import ContactTask
from expert.world.environment import Environment
from expert.world.fingers import Fingers
from expert.world.motion import Trajectory
from expert.world.shape import Body
from expert.world.walls import HalfPlane
from tests.support.random_tasks import random_body

DT, GRAVITY, MU, MARGIN = 0.1, 9.8, 0.4, 0.05


def thrown_task(rng: np.random.Generator, *, extreme: bool) -> ContactTask:
    """Two fingers push wherever they are, nothing else touches: the poses follow from Newton and Euler, step by step.

    extreme: on edges of cones, at ends of margins and at the largest force, in turns.
    """
    body = random_body(rng, int(rng.integers(3, 7)))
    weight = body.mass * GRAVITY
    most = 1.5 * weight
    on = rng.choice(len(body.vertices), 2, replace=False)
    rho = rng.choice([MARGIN, 1 - MARGIN], 2) if extreme else rng.uniform(MARGIN, 1 - MARGIN, 2)
    (a, b), (normal, tangent) = facets(body.vertices), facet_frames(body.vertices)
    place = a[on] + rho[:, None] * (b - a)[on]
    steps = int(rng.integers(2, 6))
    poses = [np.zeros(3), np.array([*rng.normal(0, 0.005, 2), rng.normal(0, 0.1)])]
    for _ in range(steps):
        across = rng.choice([-MU, MU], 2) if extreme else rng.uniform(-MU, MU, 2)
        push = most * (rng.choice([0.0, 1.0, 0.3], 2) if extreme else rng.uniform(0, 1, 2))
        force_b = push[:, None] * (normal[on] + across[:, None] * tangent[on])
        turn = rotation(poses[-1][2])
        force = (force_b @ turn.T).sum(axis=0) - [0.0, weight]
        torque = float(cross(place, force_b).sum())
        acceleration = np.array([*force / body.mass, torque / body.inertia])
        poses.append(2 * poses[-1] - poses[-2] + DT**2 * acceleration)
    path = Trajectory(dt=DT, poses=np.array(poses[1:-1]), before=poses[0], after=poses[-1])
    return ContactTask(
        body=body,
        environment=Environment(gravity=GRAVITY),
        trajectory=path,
        fingers=Fingers(count=2, friction=MU, max_force=most, facet_margin=MARGIN),
    )


def pushed_task(rng: np.random.Generator, *, extreme: bool) -> ContactTask:
    """One finger pushes a block along a floor; what the floor must bear at both corners is positive by construction.

    extreme: so that nothing is left on the rear corner, where the block would begin to tip.
    """
    width, height = rng.uniform(0.05, 0.15, 2)
    corners = np.array([[-width, -height], [width, -height], [width, height], [-width, height]]) / 2
    body, _ = Body.uniform(corners, 1.0)
    weight, mu = body.mass * GRAVITY, float(rng.uniform(0.1, 0.6))
    margin = 0.05
    low, high = (margin - 0.5) * height, (0.5 - margin) * height
    while True:
        across, at = float(rng.uniform(-MU, MU)), float(rng.uniform(low, high))
        push = float(rng.uniform(0.2, 1.5)) * weight
        force = push * np.array([1.0, across])
        total = weight - force[1]
        # moments about the centre: finger, friction, and the share of the front corner
        moment = float(cross(np.array([-width / 2, at]), force)) - mu * total * height / 2
        share = -moment / (width / 2)  # front less rear
        if extreme:
            at += (total - share) * (width / 2) / push  # raise the finger until the rear corner is unloaded
            share = total
        if total > 0 and abs(share) <= total and low <= at <= high:
            break
    speed, acceleration = 0.05, (force[0] - mu * total) / body.mass
    times = DT * np.arange(-1, 5)
    x = speed * times + 0.5 * acceleration * times**2
    if (np.diff(x[1:]) <= 2e-5 * body.size).any():  # it must slide forwards
        return pushed_task(rng, extreme=extreme)
    poses = np.column_stack([x, np.full(6, height / 2), np.zeros(6)])
    path = Trajectory(dt=DT, poses=poses[1:-1], before=poses[0], after=poses[-1])
    floor = HalfPlane(point=np.zeros(2), normal=np.array([0.0, 1.0]), friction=mu)
    fingers = Fingers(count=1, friction=MU, max_force=2 * weight, facet_margin=margin)
    return ContactTask(body=body, environment=Environment(walls=(floor,)), trajectory=path, fingers=fingers)


def feasible_task(seed: int) -> ContactTask:
    """One of both, in turns ordinary and extreme."""
    rng: np.random.Generator = np.random.default_rng(seed)
    make = thrown_task if seed % 3 else pushed_task
    return make(rng, extreme=bool(seed // 3 % 2))
