"""Exact model of a block that a driven disc pushes, in the manner of the physics engine Chipmunk.

One substep: positions move with the twists of the last one, contacts are found, the block's velocity is damped (with
damping 0 to nothing: motion is quasi-static), and each contact gives it the least impulse after which the disc does not
sink deeper: frictionless, inelastic.  A second impulse, forgotten after the substep, lifts `bias` of the penetration
beyond `slop`.  Several contacts share the work by projected Gauss-Seidel, as the engine does it.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit

from expert.geometry.pose import Array
from expert.pushing.drive import Drive
from expert.pushing.outline import Outline, outline, touch
from expert.world.shape import Shape
from expert.world.values import readonly, require

SWEEPS = 10
"""Of Gauss-Seidel per substep."""

FX, FY, FVX, FVY, X, Y, ANGLE, VX, VY, SPIN, PUSH_X, PUSH_Y, PUSH_SPIN = range(13)
"""State: finger position and velocity; block's centre, angle and velocity; velocity that mends penetration."""


class Law(NamedTuple):
    """Numbers of the compiled model: see `Block` and `Drive`."""

    edges: Outline
    gyration: float
    radius: float
    stiffness: float
    damping: float
    kept: float
    bias: float
    slop: float
    dt: float


@dataclass(frozen=True, kw_only=True)
class Block:
    """What is pushed: shape, centre of gravity (2,) in its frame, squared radius of gyration I/m, velocity kept per substep."""

    shape: Shape
    centre: Array
    gyration: float
    kept: float = 0.0
    bias: float = 0.9**60
    slop: float = 0.1

    def __post_init__(self) -> None:
        object.__setattr__(self, "centre", readonly(self.centre, (2,), "block.centre"))
        require(0 < self.gyration < np.inf, "block.gyration", "a positive number", self.gyration)
        require(0 <= self.kept < 1, "block.kept", "a fraction from 0 to below 1", self.kept)

    def law(self, drive: Drive) -> Law:
        """The numbers of the compiled model."""
        return Law(
            outline(self.shape, self.centre),
            float(self.gyration),
            float(drive.radius),
            float(drive.stiffness),
            float(drive.damping),
            float(self.kept),
            1 - self.bias**drive.dt,
            float(self.slop),
            float(drive.dt),
        )


@njit(cache=True, error_model="numpy")
def substep(law: Law, s: Array, command_x: float, command_y: float) -> None:
    """Advance the state (13,) in place by one substep of the law."""
    dt = law.dt
    s[FVX] += dt * (law.stiffness * (command_x - s[FX]) - law.damping * s[FVX])
    s[FVY] += dt * (law.stiffness * (command_y - s[FY]) - law.damping * s[FVY])
    s[FX] += dt * s[FVX]
    s[FY] += dt * s[FVY]
    for k in range(3):
        s[X + k] += dt * (s[VX + k] + s[PUSH_X + k])
        s[VX + k] *= law.kept
        s[PUSH_X + k] = 0.0
    _resolve(law, s)


@njit(cache=True, error_model="numpy")
def _resolve(law: Law, s: Array) -> None:
    """Impulses of all pieces that the disc touches."""
    c, sn = np.cos(s[ANGLE]), np.sin(s[ANGLE])
    rx, ry = s[FX] - s[X], s[FY] - s[Y]
    bx, by = c * rx + sn * ry, c * ry - sn * rx
    pieces = len(law.edges.first) - 1
    rows = np.empty((pieces, 7))  # normal, lever, mass, speed of the bias, impulse, impulse of the bias
    count = 0
    for piece in range(pieces):
        t = touch(law.edges, piece, bx, by)
        depth = law.radius - t.distance
        if depth >= 0:
            lever = t.x * t.ny - t.y * t.nx
            rows[count, 0], rows[count, 1] = c * t.nx - sn * t.ny, sn * t.nx + c * t.ny
            rows[count, 2] = lever
            rows[count, 3] = 1 / (1 + lever * lever / law.gyration)
            rows[count, 4] = law.bias * max(0.0, depth - law.slop) / law.dt
            rows[count, 5] = rows[count, 6] = 0.0
            count += 1
    for _ in range(SWEEPS if count > 1 else count):
        for k in range(count):
            _impulse(s, VX, rows[k], rows[k, 0] * s[FVX] + rows[k, 1] * s[FVY], 5, law.gyration)
            _impulse(s, PUSH_X, rows[k], rows[k, 4], 6, law.gyration)


@njit(cache=True, error_model="numpy")
def _impulse(s: Array, v: int, row: Array, wanted: float, total: int, gyration: float) -> None:
    """One contact's impulse on the velocity that starts at s[v], towards the `wanted` speed along the normal; never pulls."""
    speed = row[0] * s[v] + row[1] * s[v + 1] + row[2] * s[v + 2]
    before = row[total]
    row[total] = max(0.0, before + (wanted - speed) * row[3])
    change = row[total] - before
    s[v] += change * row[0]
    s[v + 1] += change * row[1]
    s[v + 2] += change * row[2] / gyration


@njit(cache=True, error_model="numpy")
def run(law: Law, s: Array, commands: Array, substeps: int) -> None:
    """Advance the state (13,) in place through all commands (n, 2)."""
    for k in range(len(commands)):
        for _ in range(substeps):
            substep(law, s, commands[k, 0], commands[k, 1])


@njit(cache=True, error_model="numpy")
def trace(law: Law, s: Array, commands: Array, substeps: int) -> Array:
    """Poses (n, 3) of the block's centre after each command (n, 2); the state (13,) is advanced in place."""
    poses = np.empty((len(commands), 3))
    for k in range(len(commands)):
        run(law, s, commands[k : k + 1], substeps)
        poses[k] = s[X : ANGLE + 1]
    return poses
