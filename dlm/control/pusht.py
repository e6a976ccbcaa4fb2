"""Push-T as gym-pusht states it: the T, its goal, the agent's drive, the walls.  Lengths in pixels of its 512-pixel surface."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
import shapely

from expert.geometry.pose import Array, to_world
from expert.pushing.drive import Drive
from expert.pushing.goal import Goal
from expert.pushing.impulse_model import ImpulseModel
from expert.pushing.impulses import Block
from expert.pushing.planner import Planner, Workspace, box
from expert.pushing.table import Grid, push_table
from expert.world.shape import Shape

BAR = np.array([[-60.0, 0], [60, 0], [60, 30], [-60, 30]])
STEM = np.array([[-15.0, 30], [15, 30], [15, 120], [-15, 120]])
CENTRE_OF_GRAVITY = np.array([0.0, 45.0])
GYRATION = 3000.0
"""Moment of inertia over mass."""
GOAL = np.array([256.0, 256.0, np.pi / 4])
SIDE = 512.0
"""Commands lie in the square from 0 to this."""
WALLS = (8.0, 503.0)
"""Free side of the walls, one pixel from them: contact with a wall is not modelled."""


class Settings(NamedTuple):
    """Speed of pushes [per step], error at which the T has arrived, misfit of a push that is worth learning
    from, and how well the agent's place beside the T is known [pixels]."""

    speed: float
    tolerance: float
    gate: float
    wobble: float


STATE, PIXELS = Settings(120.0, 1.8, 0.5, 0.0), Settings(100.0, 1.4, 8.0, 1.0)


@lru_cache
def block() -> Block:
    """The T."""
    shape = Shape.of_pieces([BAR, STEM])
    return Block(shape=shape, centre=CENTRE_OF_GRAVITY, gyration=GYRATION)


def about_centre(poses: Array) -> Array:
    """Poses (..., 3) of the T's own frame, moved to its centre of gravity."""
    poses = np.asarray(poses, dtype=float)
    centre = to_world(poses, CENTRE_OF_GRAVITY[None])[..., 0, :]
    return np.concatenate([centre, poses[..., 2:]], axis=-1)


@lru_cache
def pusht_planner(speed: float, wobble: float = 0.0) -> Planner:
    """Planner of the T in its world."""
    model = ImpulseModel(block(), Drive(), speed, reference=CENTRE_OF_GRAVITY)
    goal = Goal(model.shape, model.origin, about_centre(GOAL))
    space = Workspace(walls=box(*WALLS), finger_walls=box(0, SIDE))
    return Planner(push_table(model, Grid(wobble=wobble)), model, goal, space)


def coverage(pose: Array) -> float:
    """Fraction of the goal that the T covers at a pose (3,) of its centre of gravity."""
    v = block().shape.vertices - CENTRE_OF_GRAVITY
    here, there = (shapely.Polygon(to_world(p, v)) for p in (pose, about_centre(GOAL)))
    return float(here.intersection(there).area / there.area)
