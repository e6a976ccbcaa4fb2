"""What one step of one scene needs to know, as compiled code takes it."""

from typing import NamedTuple

import numpy as np

from dlm.simulator.kernels import borrowing, compiled
from dlm.simulator.scene import SceneArrays


class World(NamedTuple):
    """One scene of a batch without its padding, and how to step it.

    gyration: radius of, sqrt(inertia / mass).  damping: of the fingers' springs [N s/m].  h: time step [s].
    Few arrays: passing one costs as much as ten multiplications.
    """

    facets: np.ndarray
    walls: np.ndarray
    mass: float
    inertia: float
    gyration: float
    friction: float
    stiffness: float
    damping: float
    gravity: float
    support: float
    radius: float
    kappa: float
    regularization: float
    step_error: float
    h: float


class State(NamedTuple):
    """The object's pose and velocity (3,) and the fingers' positions (C, 2), or adjoints of these."""

    pose: np.ndarray
    velocity: np.ndarray
    fingers: np.ndarray


@compiled
def world_of(scenes: SceneArrays, b: int, settings: np.record) -> World:
    """Scene b of a batch under settings, a record of NUMBERS."""
    mass, stiffness = scenes.mass[b], scenes.stiffness[b]
    return World(
        scenes.facets[b, : scenes.vertex_count[b]],
        scenes.walls[b, : scenes.wall_count[b]],
        mass,
        scenes.inertia[b],
        np.sqrt(scenes.inertia[b] / mass),
        scenes.friction[b],
        stiffness,
        settings.damping * 2 * np.sqrt(stiffness * mass),
        scenes.gravity[b],
        scenes.support[b],
        settings.finger_radius,
        settings.kappa,
        settings.regularization,
        settings.step_error,
        scenes.dt[b] / settings.substeps,
    )


@compiled
def with_step(world: World, h: float) -> World:
    """The same scene with another time step."""
    return World(
        world.facets,
        world.walls,
        world.mass,
        world.inertia,
        world.gyration,
        world.friction,
        world.stiffness,
        world.damping,
        world.gravity,
        world.support,
        world.radius,
        world.kappa,
        world.regularization,
        world.step_error,
        h,
    )


@borrowing
def vertex_arm(x: float, y: float, cs: float, sn: float) -> tuple[float, float]:
    """A vertex seen from the centre of mass, world frame, for cosine and sine of the object's angle."""
    return cs * x - sn * y, sn * x + cs * y
