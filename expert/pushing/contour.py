"""Where the finger may stand next to the object: the closed curve of disc centres at a fixed gap from it."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely

from expert.errors import InvalidProblem
from expert.geometry.polygon import facet_frames, signed_area
from expert.geometry.pose import Array, perpendicular
from expert.world.shape import Shape

ARC_SEGMENTS = 8
"""Chords per quarter turn of the curve round a corner."""


@dataclass(frozen=True)
class Contour:
    """Closed polyline (N, 2), counter-clockwise, with the arc length (N + 1,) at its corners; frame: see `contour`."""

    corners: Array
    lengths: Array

    @property
    def length(self) -> float:
        """Of the whole curve."""
        return float(self.lengths[-1])

    def at(self, s: Array) -> tuple[Array, Array]:
        """Points and unit inward normals (..., 2) at arc lengths s, taken modulo the length.

        Near the corners of the curve, normals turn steadily from those of one chord to those of the next.
        """
        s = np.asarray(s, dtype=float) % self.length
        closed, knots, inward = self._curve
        points = np.stack([np.interp(s, self.lengths, closed[:, k]) for k in (0, 1)], -1)
        normal = np.stack([np.interp(s, knots, inward[:, k]) for k in (0, 1)], -1)
        return points, normal / np.linalg.norm(normal, axis=-1, keepdims=True)

    @cached_property
    def _curve(self) -> tuple[Array, Array, Array]:
        """The closed polyline (N + 1, 2); arc lengths (2 N + 2,) with the inward normals there (2 N + 2, 2)."""
        closed = np.concatenate([self.corners, self.corners[:1]])
        chords = np.diff(self.lengths)
        inset = np.minimum(chords / 2, np.median(chords) / 2)
        knots = np.stack([self.lengths[:-1] + inset, self.lengths[1:] - inset], -1).ravel()
        inward = np.repeat(facet_frames(self.corners)[0], 2, axis=0)
        around = np.concatenate([knots[-1:] - self.length, knots, knots[:1] + self.length])
        return closed, around, np.concatenate([inward[-1:], inward, inward[:1]])


def contour(shape: Shape, origin: Array, offset: float) -> Contour:
    """Centres at the distance `offset` from the shape, about `origin` (2,) of its frame.  Raises InvalidProblem."""
    grown = shapely.buffer(shapely.Polygon(shape.vertices - origin), offset, quad_segs=ARC_SEGMENTS)
    corners = np.array(grown.exterior.coords)[:-1]
    if not len(corners):
        raise InvalidProblem(
            "finger.radius", expected="a finger that fits beside the object", got=f"{offset:g}"
        )
    if signed_area(corners) < 0:
        corners = corners[::-1]
    steps = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
    return Contour(corners, np.concatenate([[0.0], np.cumsum(steps)]))


def turned(directions: Array, angles: Array) -> Array:
    """Unit vectors (..., 2) turned by angles (...)."""
    return np.cos(angles)[..., None] * directions + np.sin(angles)[..., None] * perpendicular(directions)
