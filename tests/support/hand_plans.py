"""Plans that are right by hand calculation: a 10 cm block of 10 g moved at constant velocity, g = 9.8."""

from typing import Any

import numpy as np

from expert.problems.contact import FREE, SUPPORT, ContactForce, ContactTask, Plan
from expert.world.environment import Environment
from expert.world.fingers import Fingers
from expert.world.motion import Trajectory
from expert.world.shape import Body
from expert.world.walls import HalfPlane

A, WEIGHT = 0.05, 0.01 * 9.8
"""Half the block's side [m] and its weight [N]."""
SQUARE = [[-A, -A], [A, -A], [A, A], [-A, A]]
BOTTOM, RIGHT, TOP, LEFT = range(4)
FLOOR_FRICTION, SUPPORT_FRICTION = 0.1, 0.3


def task_of(poses: Any, *, count: int, plane: Any = "sagittal", **fingers: Any) -> ContactTask:
    """The block above a floor along the given poses."""
    body, _ = Body.uniform(SQUARE, 0.01)
    floor = HalfPlane(point=np.zeros(2), normal=np.array([0.0, 1.0]), friction=FLOOR_FRICTION)
    walls = (floor,) if plane == "sagittal" else ()
    return ContactTask(
        body=body,
        environment=Environment(plane=plane, gravity=9.8, walls=walls, support_friction=SUPPORT_FRICTION),
        trajectory=Trajectory.of(poses, 0.1),
        fingers=Fingers(**{"count": count, "friction": 0.1, "max_force": 0.98, **fingers}),
    )


def sliding_block() -> tuple[ContactTask, Plan]:
    """One finger at half height pushes the block along the floor: mu m g, and the front edge carries the larger load.

    N_front - N_back = mu m g by the balance of moments, since the finger acts at the height of the centre of mass.
    """
    x = 0.01 * np.arange(5)
    task = task_of(np.column_stack([x, np.full(5, A), np.zeros(5)]), count=1)
    push = FLOOR_FRICTION * WEIGHT
    contacts = [
        ContactForce(
            step=t,
            vertex=v,
            wall=0,
            point=np.array([x[t] + side * A, 0.0]),
            force=(WEIGHT + side * push) / 2 * np.array([-FLOOR_FRICTION, 1.0]),
        )
        for t in range(5)
        for v, side in ((0, -1), (1, 1))
    ]
    plan = Plan(
        status="optimal",
        objective=5 * push**2,
        bound=5 * push**2,
        modes=np.full((5, 1), LEFT),
        positions=np.column_stack([x - A, np.full(5, A)])[:, None],
        forces=np.tile([push, 0.0], (5, 1, 1)),
        contact_forces=tuple(contacts),
    )
    return task, plan


def lifted_block() -> tuple[ContactTask, Plan]:
    """Two fingers squeeze the block from both sides, each on the edge of its cone with m g / 2, and lift it."""
    y = A + 0.02 * np.arange(5)
    task = task_of(np.column_stack([np.zeros(5), y, np.zeros(5)]), count=2)
    squeeze = WEIGHT / 2 / 0.1
    sides = np.array([-1.0, 1.0])
    plan = Plan(
        status="optimal",
        objective=10 * (squeeze**2 + WEIGHT**2 / 4),
        bound=10 * (squeeze**2 + WEIGHT**2 / 4),
        modes=np.tile([LEFT, RIGHT], (5, 1)),
        positions=np.stack([np.tile(sides * A, (5, 1)), np.tile(y[:, None], (1, 2))], axis=-1),
        forces=np.tile(np.column_stack([-sides * squeeze, [WEIGHT / 2] * 2]), (5, 1, 1)),
    )
    return task, plan


def pushed_block() -> tuple[ContactTask, Plan]:
    """Transverse plane: one finger behind the centre overcomes mu m g, a quarter of it at each corner."""
    x = 0.01 * np.arange(5)
    task = task_of(np.column_stack([x, np.zeros(5), np.zeros(5)]), count=2, plane="transverse")
    push = SUPPORT_FRICTION * WEIGHT
    corners = np.array(SQUARE)
    contacts = [
        ContactForce(
            step=t, vertex=v, wall=SUPPORT, point=corners[v] + [x[t], 0.0], force=np.array([-push / 4, 0.0])
        )
        for t in range(5)
        for v in range(4)
    ]
    idle = np.tile([0.0, 0.2], (5, 1))  # the second finger waits far away
    plan = Plan(
        status="optimal",
        objective=5 * push**2,
        bound=5 * push**2,
        modes=np.tile([LEFT, FREE], (5, 1)),
        positions=np.stack([np.column_stack([x - A, np.zeros(5)]), idle], axis=1),
        forces=np.stack([np.tile([push, 0.0], (5, 1)), np.zeros((5, 2))], axis=1),
        contact_forces=tuple(contacts),
    )
    return task, plan
