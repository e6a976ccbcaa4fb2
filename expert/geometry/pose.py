"""Planar rigid motions: pose = (x, y, theta), angles in rad, counter-clockwise."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def rotation(theta: ArrayLike) -> Array:
    """Rotation matrices, shape theta.shape + (2, 2)."""
    c, s = np.cos(theta), np.sin(theta)
    return np.stack([np.stack([c, -s], -1), np.stack([s, c], -1)], -2)


def wrapped(angle: ArrayLike) -> Array:
    """The same orientations [rad] within half a turn of zero."""
    return (np.asarray(angle) + np.pi) % (2 * np.pi) - np.pi


def to_world(pose: ArrayLike, points_b: ArrayLike) -> Array:
    """Body points (..., n, 2) [m] at poses (..., 3), in the world frame."""
    pose = np.asarray(pose, dtype=float)
    return pose[..., None, :2] + np.asarray(points_b) @ np.swapaxes(rotation(pose[..., 2]), -1, -2)


def to_body(pose: ArrayLike, points_w: ArrayLike) -> Array:
    """World points (..., n, 2) [m] at poses (..., 3), in the body frame."""
    pose = np.asarray(pose, dtype=float)
    return (np.asarray(points_w) - pose[..., None, :2]) @ rotation(pose[..., 2])


def moved_origin(poses: ArrayLike, point_b: ArrayLike) -> Array:
    """Poses (..., 3) of a body frame as those of the parallel frame whose origin is its point (2,) [m]."""
    poses = np.asarray(poses, dtype=float)
    return np.concatenate([to_world(poses, np.asarray(point_b)[None])[..., 0, :], poses[..., 2:]], axis=-1)


def cross(u: ArrayLike, v: ArrayLike) -> Array:
    """Planar cross product u_x v_y - u_y v_x over the last axis."""
    u, v = np.asarray(u, dtype=float), np.asarray(v, dtype=float)
    return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]


def perpendicular(u: ArrayLike) -> Array:
    """u turned by +90 degrees, so that cross(u, v) = perpendicular(u) . v."""
    u = np.asarray(u, dtype=float)
    return np.stack([-u[..., 1], u[..., 0]], -1)
