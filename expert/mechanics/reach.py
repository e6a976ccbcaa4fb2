"""Where fingers may be: on facets, around the object, off the walls (Thesis 3-CT3, 3-CT7)."""

import numpy as np

from expert.geometry.convex import free_regions
from expert.geometry.pose import Array, rotation, to_world
from expert.problems.contact import ContactTask


def rho_limits(task: ContactTask, a: Array, b: Array) -> tuple[Array, Array]:
    """Range of rho on each facet at each step, (T, F) each: the facet margin, and the clearance from walls."""
    margin = task.fingers.facet_margin
    low, high = np.full(a.shape[:2], margin), np.full(a.shape[:2], 1 - margin)
    for wall in task.environment.walls:
        start = wall.gap(a) - task.fingers.clearance
        slope = wall.gap(b) - wall.gap(a)  # need start + rho slope >= 0
        flat = np.abs(slope) <= 1e-12 * task.body.size
        root = -start / np.where(flat, 1.0, slope)
        low = np.where(~flat & (slope > 0), np.maximum(low, root), low)
        high = np.where(~flat & (slope < 0), np.minimum(high, root), high)
        high = np.where(flat & (start < 0), -np.inf, high)
    return low, high


def wall_rows(task: ContactTask) -> Array:
    """Rows (n, d) [1, m] of n.x >= d for fingers, clearance included, (W, 3)."""
    rows = [[*w.normal, float(w.normal @ w.point) + task.fingers.clearance] for w in task.environment.walls]
    return np.array(rows, dtype=float).reshape(-1, 3)


def region_rows(task: ContactTask) -> Array:
    """Convex regions around the object with its clearance: rows (a, b) of a.x <= b, (T, R, H, 3), world frame."""
    regions = free_regions(task.body.vertices, task.robustness.free_clearance)
    most = max(len(r.b) for r in regions)
    rows = np.tile(np.array([0.0, 0.0, 1.0]), (task.steps, len(regions), most, 1))
    turn = rotation(task.trajectory.poses[:, 2])
    for k, region in enumerate(regions):
        normals = np.einsum("tde,he->thd", turn, region.A)
        shift = np.einsum("thd,td->th", normals, task.trajectory.poses[:, :2])
        rows[:, k, : len(region.b), :2] = normals
        rows[:, k, : len(region.b), 2] = region.b + shift
    return rows


def parking_place(task: ContactTask) -> Array:
    """A point (2,) [m] that walls and object leave clear at every step, nan if none is found nearby."""
    poses, L = task.trajectory.poses, task.body.size
    angles = np.pi / 2 + np.pi * np.array([0, 1, -1, 2, -2, 3, -3, 4]) / 4
    directions = np.column_stack([np.cos(angles), np.sin(angles)])
    middle = poses[:, :2].mean(axis=0)
    radius = 1.2 * L + task.robustness.free_clearance + np.abs(poses[:, :2] - middle).max() * np.sqrt(2)
    for place in middle + radius * directions:
        if all(w.gap(place) >= task.fingers.clearance for w in task.environment.walls):
            return place
    return np.full(2, np.nan)


def workspace(task: ContactTask) -> Array:
    """Box (2, d) [m] for finger positions: what the object sweeps, and beyond it the reach of a finger that
    leaves at the speed of the fastest vertex and is never slowed down (more would cost acceleration for nothing)."""
    vertices = to_world(task.trajectory.poses, task.body.vertices)
    fastest = np.linalg.norm(np.diff(vertices, axis=0), axis=2).max()
    reach = (
        task.body.size + task.steps * fastest + max(task.fingers.clearance, task.robustness.free_clearance)
    )
    return np.stack([vertices.min(axis=(0, 1)) - reach, vertices.max(axis=(0, 1)) + reach])
