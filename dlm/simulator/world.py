"""What one step of one scene needs to know, as compiled code takes it."""

from typing import NamedTuple

import numpy as np
from numba import njit

from dlm.simulator.scene import SceneArrays


class World(NamedTuple):
    """One scene of a batch without its padding, and how to step it.

    h: time step [s].  give: velocity of a finger per impulse on it; follow: its velocity per distance to its command.
    Few arrays: passing one costs as much as ten multiplications.
    """

    facets: np.ndarray
    walls: np.ndarray
    mass: float
    inertia: float
    friction: float
    stiffness: float
    damping: float
    gravity: float
    support: float
    radius: float
    kappa: float
    regularization: float
    h: float
    give: float
    follow: float


class State(NamedTuple):
    """The object's pose and velocity (3,) and the fingers' positions (C, 2), or adjoints of these."""

    pose: np.ndarray
    velocity: np.ndarray
    fingers: np.ndarray


@njit(cache=True, error_model="numpy")
def world_of(scenes: SceneArrays, b: int, settings: np.record) -> World:
    """Scene b of a batch under settings, a record of NUMBERS."""
    h = scenes.dt[b] / settings.substeps
    resistance = scenes.stiffness[b] * h + settings.damping
    return World(
        scenes.facets[b, : scenes.vertex_count[b]],
        scenes.walls[b, : scenes.wall_count[b]],
        scenes.mass[b],
        scenes.inertia[b],
        scenes.friction[b],
        scenes.stiffness[b],
        settings.damping,
        scenes.gravity[b],
        scenes.support[b],
        settings.finger_radius,
        settings.kappa,
        settings.regularization,
        h,
        1 / (h * resistance),
        scenes.stiffness[b] / resistance,
    )


@njit(cache=True, error_model="numpy")
def vertex_arm(x: float, y: float, cs: float, sn: float) -> tuple[float, float]:
    """A vertex seen from the centre of mass, world frame, for cosine and sine of the object's angle."""
    return cs * x - sn * y, sn * x + cs * y
