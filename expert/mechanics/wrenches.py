"""Forces as wrenches, edges of friction cones, and the wrench that a motion needs."""

import numpy as np

from expert.geometry.pose import Array, cross, perpendicular
from expert.problems.contact import ContactTask


def friction_rays(normal: Array, friction: float | Array) -> Array:
    """Edges n + mu tau, n - mu tau of the cones about unit normals (..., 2): shape (..., 2 rays, 2); tau = n turned by -90 deg."""
    tangent = -perpendicular(normal)
    mu = np.asarray(friction, dtype=float)[..., None]
    return np.stack([normal + mu * tangent, normal - mu * tangent], axis=-2)


def wrench_about(force: Array, point: Array, centre: Array) -> Array:
    """Force (..., 2) [N] at point (..., 2) [m] as a wrench (..., 3) about `centre`."""
    arm = np.asarray(point) - centre
    return np.concatenate([np.asarray(force, dtype=float), cross(arm, force)[..., None]], axis=-1)


def inertial_wrench(task: ContactTask) -> Array:
    """What all contacts together must exert, (T, 3) [N, N, N m]: m (q_ddot - g), I theta_ddot (Thesis 3-CT1, 3-CT2)."""
    a = task.trajectory.accelerations
    wrench = np.column_stack([task.body.mass * a[:, :2], task.body.inertia * a[:, 2]])
    if task.environment.plane == "sagittal":
        wrench[:, 1] += task.weight
    return wrench
