"""A finger on a spring and damper: commands that bring it to rest at a point, on the way through other points.

The drive is linear and the same along x and y: position and velocity after a control step are A (p, v) + b u.
"""

from dataclasses import dataclass
from functools import cache, lru_cache

import numpy as np

from expert.geometry.pose import Array
from expert.world.values import require


@dataclass(frozen=True, kw_only=True)
class Drive:
    """A finger's disc on a spring and damper to its command, and the clock: substeps of dt [s] per control step.

    Acceleration = stiffness (command - position) - damping velocity, whatever the finger touches.
    """

    radius: float = 15.0
    stiffness: float = 100.0
    damping: float = 20.0
    dt: float = 0.01
    substeps: int = 10

    def __post_init__(self) -> None:
        for name in ("radius", "stiffness", "damping", "dt", "substeps"):
            value = getattr(self, name)
            require(0 < value < np.inf, f"drive.{name}", "a positive number", value)

    def after(self, position: Array, velocity: Array, command: Array) -> tuple[Array, Array]:
        """Position and velocity (2,) one control step later."""
        a, b = step_map(self)
        return a[0, 0] * position + a[0, 1] * velocity + b[0] * command, (
            a[1, 0] * position + a[1, 1] * velocity + b[1] * command
        )

    def commands(
        self, steps: int, position: Array, velocity: Array, end: Array, via: dict[int, Array]
    ) -> Array:
        """Least-acceleration commands (steps, 2) to rest at `end`, at the points via[j] after j steps."""
        gain = gains(self, steps, tuple(via))
        return gain @ np.stack([position, velocity, end, *via.values()])


@lru_cache
def substep_map(drive: Drive) -> tuple[Array, Array]:
    """A (2, 2) and b (2,) of one substep: velocity first, then position with the new velocity."""
    dt = drive.dt
    velocity = np.array([-drive.stiffness * dt, 1 - drive.damping * dt])
    a = np.array([np.array([1.0, 0.0]) + dt * velocity, velocity])
    return a, np.array([dt * dt * drive.stiffness, dt * drive.stiffness])


@lru_cache
def step_map(drive: Drive) -> tuple[Array, Array]:
    """A (2, 2) and b (2,) of one control step; a finger at rest on its command stays there, so b = (I - A) e_1."""
    a = np.linalg.matrix_power(substep_map(drive)[0], drive.substeps)
    return a, np.array([1 - a[0, 0], -a[1, 0]])


@cache
def gains(drive: Drive, steps: int, via: tuple[int, ...]) -> Array:
    """Matrix (steps, 3 + len(via)): commands = matrix @ (p, v, end, via points), of least summed squared acceleration.

    Raises InvalidProblem for fewer steps than 2 + len(via), or via steps outside 1 ... steps - 1.
    """
    require(steps >= 2 + len(via), "steps", "at least 2, and one more for each point on the way", steps)
    require(all(0 < j < steps for j in via), "via", f"steps from 1 to {steps - 1}", via)
    accelerations, states = _responses(drive, steps)
    rows = np.concatenate([states[-1], states[[j - 1 for j in via], 0]])
    wanted = np.zeros((len(rows), 3 + len(via)))
    wanted[0, 2] = 1
    wanted[2:, 3:] = np.eye(len(via))
    wanted[:, :2] -= rows[:, :2]
    return _least_squares(accelerations, rows[:, 2:], wanted)


@lru_cache
def _responses(drive: Drive, steps: int) -> tuple[Array, Array]:
    """Answers to (p0, v0, u): accelerations (substeps, 2 + steps), and (p, v) after each step (steps, 2, 2 + steps)."""
    a, b = substep_map(drive)
    response = np.concatenate([np.eye(2), np.zeros((2, steps))], axis=1)
    accelerations, states = [], []
    for k in range(steps):
        for _ in range(drive.substeps):
            moved = a @ response
            moved[:, 2 + k] += b
            accelerations.append(moved[1] - response[1])
            response = moved
        states.append(response)
    return np.array(accelerations), np.array(states)


def _least_squares(effort: Array, rows: Array, wanted: Array) -> Array:
    """u = matrix @ data of least |effort (data_01, u)| subject to rows u = wanted data."""
    start, e = effort[:, :2], effort[:, 2:]
    n, m = e.shape[1], len(rows)
    kkt = np.block([[e.T @ e, rows.T], [rows, np.zeros((m, m))]])
    right = np.zeros((n + m, wanted.shape[1]))
    right[:n, :2] = -e.T @ start
    right[n:] = wanted
    return np.linalg.lstsq(kkt, right, rcond=None)[0][:n]
