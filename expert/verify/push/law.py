"""How an object on a support answers to one finger: balance of forces and Coulomb's law at the contact.

The finger's force balances the support's friction, which acts against the velocity of every point of the face (`uniform`
pressure), or as the normal of an ellipsoid.  The contact sticks if its force is inside the friction cone; else the force
is on the cone's edge, and the object lags behind the finger.  All in the frame of the object, about its centroid.
"""

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from scipy.optimize import brentq

from expert.geometry.convex import convex_pieces
from expert.geometry.pose import Array, cross, perpendicular
from expert.problems.push import LimitSurface
from expert.world.shape import Shape

FINEST = 400
"""At least so many parts of the face have pressure points of their own."""
Mode = Literal["free", "sticking", "sliding"]


@dataclass(frozen=True)
class Answer:
    """Velocity (2,) of the centroid and spin, force (2,) of the finger up to a factor, and how the contact moves."""

    velocity: Array
    spin: float
    force: Array
    mode: Mode


class Support(Protocol):
    """Friction of the support."""

    def held(self, at: Array, velocity: Array) -> tuple[Array, float]:
        """Force (2,) up to a factor, and spin, where the point `at` (2,) of the object has a velocity, and only force acts there."""


@dataclass(frozen=True)
class Face:
    """Uniform pressure: points (K, 2) about the centroid, and the area of each."""

    points: Array
    areas: Array

    @classmethod
    def of(cls, shape: Shape, centroid: Array) -> "Face":
        """Triangles of the polygon, halved until there are enough."""
        pieces = convex_pieces(shape.vertices)
        fans = [np.stack([p[0], p[k], p[k + 1]]) for p in pieces for k in range(1, len(p) - 1)]
        triangles = np.array(fans) - centroid
        while len(triangles) < FINEST:
            triangles = _quartered(triangles)
        sides = triangles[:, 1:] - triangles[:, :1]
        return cls(triangles.mean(axis=1), np.abs(cross(sides[:, 0], sides[:, 1])) / 2)

    def held(self, at: Array, velocity: Array) -> tuple[Array, float]:
        """Force (2,) up to a factor, and spin."""
        x, y = (self.points - at).T
        (ux, uy), speed = velocity, float(np.hypot(*velocity))

        def friction(spin: float) -> tuple[Array, Array]:
            vx, vy = ux - spin * y, uy + spin * x
            share = self.areas / (np.sqrt(vx * vx + vy * vy) + 1e-9 * speed)
            return share * vx, share * vy

        def torque(spin: float) -> float:
            fx, fy = friction(spin)
            return float(x @ fy - y @ fx)

        bound = speed / float(np.hypot(x, y).max())
        while torque(bound) <= 0 or torque(-bound) >= 0:
            bound *= 2
        spin = float(brentq(torque, -bound, bound, xtol=1e-10 * bound))
        return np.array([force.sum() for force in friction(spin)]), spin


@dataclass(frozen=True)
class Ellipsoid:
    """Wrenches (f, c t) on a sphere: the twist is its normal."""

    c: float

    def held(self, at: Array, velocity: Array) -> tuple[Array, float]:
        """Force (2,) up to a factor, and spin."""
        arm = perpendicular(at)
        force = np.linalg.solve(np.eye(2) + np.outer(arm, arm) / self.c**2, velocity)
        return np.asarray(force), float(cross(at, force)) / self.c**2


def support(surface: LimitSurface, shape: Shape, centroid: Array) -> Support:
    """The friction that a problem states."""
    return Face.of(shape, centroid) if surface.c is None else Ellipsoid(surface.c)


def answer(under: Support, at: Array, normal: Array, velocity: Array, friction: float) -> Answer:
    """Of the object, touched at a point (2,) with inward normal (2,) by a finger with a velocity (2,)."""
    forward, along = float(normal @ velocity), float(perpendicular(normal) @ velocity)
    if forward <= 0:
        return Answer(np.zeros(2), 0.0, np.zeros(2), "free")

    def held(slip: float) -> tuple[Array, float]:
        return under.held(at, forward * normal + slip * perpendicular(normal))

    def beyond(slip: float, side: float) -> float:
        force, _ = held(slip)
        force = force / np.linalg.norm(force)
        return side * float(perpendicular(normal) @ force) - friction * float(normal @ force)

    mode: Mode = "sticking"
    for side in (1.0, -1.0):
        if (
            beyond(along, side) > 0
        ):  # too much force across: the contact slides, and the object lags on that side
            mode, back = "sliding", forward
            while beyond(along - side * back, side) > 0:
                back *= 2
            ends = sorted((along - side * back, along))
            along = float(brentq(beyond, *ends, args=(side,), xtol=1e-9 * forward))
            break
    force, spin = held(along)
    touched = forward * normal + along * perpendicular(normal)
    return Answer(touched - spin * perpendicular(at), spin, force, mode)


def _quartered(triangles: Array) -> Array:
    """Each triangle (N, 3, 2) as four."""
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    d, e, f = (a + b) / 2, (b + c) / 2, (c + a) / 2
    return np.concatenate([np.stack(part, axis=1) for part in ((a, d, f), (d, b, e), (f, e, c), (d, e, f))])


def vote(at: Array, normal: Array, velocity: Array, friction: float) -> float:
    """Mason's voting theorem: the sense in which the object turns, by the cone's edges and the push; 0: no majority."""
    edges = [normal + side * friction * perpendicular(normal) for side in (1.0, -1.0)]
    return float(np.sign(sum(np.sign(cross(at, ray)) for ray in [*edges, velocity])))
