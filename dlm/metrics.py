"""How far a simulated motion is from the desired one; every function takes numpy arrays or torch tensors."""

import sys
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

if TYPE_CHECKING:
    import torch

T = TypeVar("T", np.ndarray, "torch.Tensor")

LEVER = 0.03
"""Arm that turns angles into lengths in the metric [m]."""


def motion_error(simulated: T, desired: T) -> T:
    """Entries (x, y, 0.03 m sin theta) of simulated minus desired poses (..., 3) [m]."""
    library: Any = sys.modules[
        type(simulated).__module__.partition(".")[0]
    ]  # numpy or torch, whichever made it
    turn = LEVER * (library.sin(simulated[..., 2]) - library.sin(desired[..., 2]))
    move = simulated[..., :2] - desired[..., :2]
    return library.stack([move[..., 0], move[..., 1], turn], -1)


def object_trajectory_loss(simulated: T, desired: T) -> T:
    """||Sim(p) - r||^2 (Thesis 4-CT10): mean of (100 error)^2 over x, y, 0.03 m sin theta and all T frames,
    poses (..., T, 3) -> (...) [cm^2]."""
    return ((100 * motion_error(simulated, desired)) ** 2).mean((-2, -1))


def finger_trajectory_loss(positions: T, labels: T) -> T:
    """Mean of (100 error)^2 over all coordinates, finger positions (..., T, C, 2) -> (...) [cm^2]."""
    return ((100 * (positions - labels)) ** 2).mean((-3, -2, -1))


def translation_error(simulated: T, desired: T) -> T:
    """Distance between poses (..., 3) [mm]."""
    return 1e3 * ((simulated[..., :2] - desired[..., :2]) ** 2).sum(-1) ** 0.5


def rotation_error(simulated: T, desired: T) -> T:
    """Angle between poses (..., 3), the shorter way round [deg]."""
    turn = simulated[..., 2] - desired[..., 2]
    return (180 / np.pi) * abs((turn + np.pi) % (2 * np.pi) - np.pi)


def within(simulated: T, desired: T, *, mm: float = 2.0, deg: float = 2.0) -> T:
    """Whether final poses, of motions (..., T, 3), agree to so many mm and deg."""
    last, goal = simulated[..., -1, :], desired[..., -1, :]
    return (translation_error(last, goal) <= mm) & (rotation_error(last, goal) <= deg)


def rms_errors(simulated: T, desired: T) -> tuple[T, T]:
    """Root mean square over the T frames of motions (..., T, 3): translation [mm] and rotation [deg]."""
    move, turn = translation_error(simulated, desired), rotation_error(simulated, desired)
    return (move**2).mean(-1) ** 0.5, (turn**2).mean(-1) ** 0.5
