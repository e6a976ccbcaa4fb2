"""Similarity between the world and the relative lengths in which cages, grasps and executions are computed."""

from dataclasses import dataclass

import numpy as np
import shapely

from expert.geometry.pose import Array, moved_origin, rotation, to_world
from expert.world.shape import Shape


@dataclass(frozen=True)
class Frame:
    """A reference point of the object is the origin, a radius [m] is 1, and a pose is the origin of configuration space."""

    centre: Array
    radius: float
    pose: Array

    @classmethod
    def of(cls, shape: Shape, pose: Array) -> "Frame":
        """Frame of a shape at its start pose (3,) by its enclosing circle: reference point and radius are the circle's."""
        circle = shapely.minimum_bounding_circle(shapely.MultiPoint(shape.vertices))
        centre = np.array(circle.centroid.coords[0])
        return cls(centre, float(np.linalg.norm(shape.vertices - centre, axis=1).max()), pose)

    @property
    def reference_w(self) -> Array:
        """The reference point at the start pose (2,) [m], world."""
        return to_world(self.pose, self.centre[None])[0]

    def relative(self, points_w: Array) -> Array:
        """World points (..., 2) [m] in the relative frame."""
        return (points_w - self.reference_w) @ rotation(self.pose[2]) / self.radius

    def world(self, points: Array) -> Array:
        """Relative points (..., 2) in the world [m]."""
        return self.reference_w + self.radius * points @ rotation(self.pose[2]).T

    def body(self, points_b: Array) -> Array:
        """Points (..., 2) of the body frame [m] in the relative frame at the start."""
        return (points_b - self.centre) / self.radius

    def world_pose(self, configuration: Array) -> Array:
        """Body poses (..., 3) [m, rad] of relative configurations (..., 3)."""
        angle = self.pose[2] + configuration[..., 2:]
        return moved_origin(
            np.concatenate([self.world(configuration[..., :2]), angle], axis=-1), -self.centre
        )

    def configuration(self, pose: Array) -> Array:
        """Relative configurations (..., 3) of body poses (..., 3) [m, rad]."""
        moved = moved_origin(pose, self.centre)
        return np.concatenate([self.relative(moved[..., :2]), moved[..., 2:] - self.pose[2]], axis=-1)
