"""Where the object shall be, and how far it is: root-mean-square displacement of its points, over its symmetries."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely

from expert.geometry.polygon import mass_properties
from expert.geometry.pose import Array, rotation, to_world, wrapped
from expert.world.shape import Shape

SAME = 1e-6
"""A rotation about the centroid is a symmetry where what it misses is at most this fraction of the area."""


@dataclass(frozen=True)
class Goal:
    """Goal pose (3,) of a shape's frame moved to `origin` (2,), as `PushModel` has it; symmetric: or one that looks the same."""

    shape: Shape
    origin: Array
    pose: Array
    symmetric: bool = True

    @cached_property
    def centroid(self) -> Array:
        """Of the shape's area, relative to the origin (2,)."""
        return mass_properties(self.shape.vertices).centroid - self.origin

    @cached_property
    def spread(self) -> float:
        """Squared radius of gyration of the area about its centroid."""
        plate = mass_properties(self.shape.vertices)
        return plate.second_moment / plate.area

    @cached_property
    def poses(self) -> Array:
        """Poses (G, 3) that are the goal."""
        turns = symmetries(self.shape) if self.symmetric else np.zeros(1)
        angles = self.pose[2] + turns
        centre = to_world(self.pose, self.centroid[None])[0]
        return np.column_stack([centre - self.centroid @ np.swapaxes(rotation(angles), -1, -2), angles])

    def error(self, poses: Array) -> Array:
        """Root-mean-square distance (...) of the object's points from the nearest goal, at poses (..., 3)."""
        return np.sqrt((self.residual(poses) ** 2).sum(-1))

    def residual(self, poses: Array) -> Array:
        """Vectors (..., 3) of that length: displacement of the centroid, and the rotation's share."""
        poses = np.asarray(poses)
        offset = centroids(poses, self.centroid)[..., None, :] - centroids(self.poses, self.centroid)
        turn = 2 * np.sqrt(self.spread) * np.sin(wrapped(poses[..., None, 2] - self.poses[:, 2]) / 2)
        rows = np.concatenate([offset, turn[..., None]], axis=-1)
        nearest = (rows**2).sum(-1).argmin(-1)
        return np.take_along_axis(rows, nearest[..., None, None], axis=-2)[..., 0, :]


def centroids(poses: Array, centroid: Array) -> Array:
    """World position (..., 2) of the body point at poses (..., 3)."""
    return poses[..., :2] + centroid @ np.swapaxes(rotation(poses[..., 2]), -1, -2)


def symmetries(shape: Shape) -> Array:
    """Angles of the rotations about the centroid that leave the shape as it is, 0 first."""
    plate = mass_properties(shape.vertices)
    v = shape.vertices - plate.centroid
    polygon = shapely.Polygon(v)
    folds = [n for n in range(2, len(v) + 1) if _invariant(polygon, v, 2 * np.pi / n)]
    return np.arange(max(folds, default=1)) * 2 * np.pi / max(folds, default=1)


def _invariant(polygon: shapely.Polygon, v: Array, angle: float) -> bool:
    other = shapely.Polygon(v @ rotation(angle).T)
    return bool(polygon.symmetric_difference(other).area <= SAME * polygon.area)
