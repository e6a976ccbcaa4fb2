"""Outcomes of straight pushes on a table with friction: the disc sticks to the object, or slides along it.

Quasi-static: what happens depends on the finger's way, not on its speed.  A push that comes to touch the object at two places
at once is beyond the law of one contact, and has no outcome.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numba import njit

from expert.geometry.pose import Array
from expert.pushing.limit_surface import FREE, Surface, motion
from expert.pushing.outline import Outline, outline, touch
from expert.world.shape import Shape

STEP, TOUCHING = 0.01, 1e-6
"""Longest step of the integration, and distance that counts as contact, over the object's size."""
SAME_NORMAL = 0.95
"""Cosine: what touches with normals nearer than that is one contact."""


class Law(NamedTuple):
    """Numbers of the compiled model, about the centre of pressure: see `CoulombModel`; size: of the object."""

    edges: Outline
    surface: Surface
    radius: float
    friction: float
    size: float


class Contact(NamedTuple):
    """Gap, normal n into the object and nearest point (x, y), in its frame; whether it is touched elsewhere, too."""

    gap: float
    nx: float
    ny: float
    x: float
    y: float
    doubled: bool


@dataclass(frozen=True, kw_only=True)
class CoulombModel:
    """A shape on a support, pushed by a disc with friction at a speed [length/s]; frame: the shape's, moved to `origin`.

    surface: the support's limit surface about the origin, its centre of pressure.
    """

    shape: Shape
    origin: Array
    surface: Surface
    radius: float
    friction: float
    speed: float

    @cached_property
    def edges(self) -> Outline:
        """The outline about the origin."""
        return outline(self.shape, self.origin)

    @cached_property
    def law(self) -> Law:
        """The numbers of the compiled model."""
        return Law(self.edges, self.surface, self.radius, float(self.friction), self.shape.size)

    def steps(self, lengths: Array) -> Array:
        """Duration of pushes of lengths (N,) [s]."""
        return lengths / self.speed

    def leads(self, lengths: Array) -> Array:
        """A finger that is led goes no farther than its end (N,)."""
        return lengths

    def outcomes(self, starts: Array, directions: Array, lengths: Array) -> tuple[Array, Array]:
        """Pose changes (N, 3), and the finger's end in the new frame (N, 2); nan where a push has no outcome.

        A push that begins with the one before it goes on from there.
        """
        rows = (np.ascontiguousarray(values, dtype=float) for values in (starts, directions, lengths))
        return _outcomes(self.law, *rows)

    def path(self, start: Array, direction: Array, length: float, count: int) -> Array:
        """Poses (count, 3) on the way of one push, its start and its end included."""
        lengths = np.linspace(0.0, length, count)
        return self.outcomes(np.tile(start, (count, 1)), np.tile(direction, (count, 1)), lengths)[0]


@njit(cache=True, error_model="numpy")
def _outcomes(law: Law, starts: Array, directions: Array, lengths: Array) -> tuple[Array, Array]:
    poses, fingers = np.empty((len(starts), 3)), np.empty((len(starts), 2))
    pose, gone = np.zeros(3), 0.0
    for i in range(len(starts)):
        goes_on = i > 0 and lengths[i] >= lengths[i - 1]
        for d in range(2):
            goes_on &= starts[i, d] == starts[i - 1, d] and directions[i, d] == directions[i - 1, d]
        if not goes_on:
            pose[:], gone = 0.0, 0.0
        _go_on(law, pose, starts[i], directions[i], gone, lengths[i])
        gone = lengths[i]
        poses[i] = pose
        x, y = starts[i, 0] + gone * directions[i, 0], starts[i, 1] + gone * directions[i, 1]
        fingers[i] = _seen_from(pose, x, y)
    return poses, fingers


@njit(cache=True, error_model="numpy")
def _go_on(law: Law, pose: Array, start: Array, direction: Array, gone: float, length: float) -> None:
    """Carry the pose (3,) along while the finger goes on; nan from a second contact on."""
    middle, (ux, uy) = np.empty(3), direction
    while gone < length and not np.isnan(pose[0]):
        x, y = start[0] + gone * ux, start[1] + gone * uy
        contact = _contact(law, pose, x, y)
        if contact.gap > TOUCHING * law.size:
            gone += min(contact.gap, length - gone)
            continue
        if contact.doubled:
            pose[:] = np.nan
            return
        step = min(STEP * law.size, length - gone)
        middle[:] = pose
        if _follow(law, contact, pose, ux, uy, middle, 0.5 * step):  # midpoint rule
            halfway = _contact(law, middle, x + 0.5 * step * ux, y + 0.5 * step * uy)
            _follow(law, halfway, middle, ux, uy, pose, step)
            _push_out(law, pose, x + step * ux, y + step * uy)
        gone += step


@njit(cache=True, error_model="numpy")
def _push_out(law: Law, pose: Array, x: float, y: float) -> None:
    """What little the disc has sunk in moves the object straight off it."""
    contact = _contact(law, pose, x, y)
    if contact.gap < -TOUCHING * law.size:
        c, s = np.cos(pose[2]), np.sin(pose[2])
        ux, uy = c * contact.nx - s * contact.ny, s * contact.nx + c * contact.ny
        _follow(law, contact, pose.copy(), ux, uy, pose, -contact.gap)


@njit(cache=True, error_model="numpy")
def _follow(law: Law, contact: Contact, at: Array, ux: float, uy: float, pose: Array, step: float) -> bool:
    """Move a pose as the object at a pose `at` does under a finger with velocity u; whether it moves."""
    c, s = np.cos(at[2]), np.sin(at[2])
    bx, by = c * ux + s * uy, c * uy - s * ux
    moved = motion(law.surface, contact.x, contact.y, contact.nx, contact.ny, bx, by, law.friction)
    pose[0] += step * (c * moved.vx - s * moved.vy)
    pose[1] += step * (s * moved.vx + c * moved.vy)
    pose[2] += step * moved.spin
    return moved.mode != FREE


@njit(cache=True, error_model="numpy")
def _seen_from(pose: Array, x: float, y: float) -> tuple[float, float]:
    """A point in the frame of a pose."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return c * (x - pose[0]) + s * (y - pose[1]), c * (y - pose[1]) - s * (x - pose[0])


@njit(cache=True, error_model="numpy")
def _contact(law: Law, pose: Array, x: float, y: float) -> Contact:
    """How the disc at (x, y) lies to the object at a pose."""
    bx, by = _seen_from(pose, x, y)
    near = touch(law.edges, 0, bx, by)
    for piece in range(1, len(law.edges.first) - 1):
        other = touch(law.edges, piece, bx, by)
        if other.distance < near.distance:
            near = other
    doubled = False
    for piece in range(len(law.edges.first) - 1):
        other = touch(law.edges, piece, bx, by)
        apart = other.nx * near.nx + other.ny * near.ny < SAME_NORMAL
        doubled |= apart and other.distance - law.radius <= TOUCHING * law.size
    return Contact(near.distance - law.radius, near.nx, near.ny, near.x, near.y, doubled)
