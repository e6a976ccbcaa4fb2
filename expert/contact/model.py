"""A contact task as arrays without dimension: length L (object size), force m g, torque m g L."""

from typing import NamedTuple

import numpy as np

from expert.geometry.convex import free_regions
from expert.geometry.pose import Array, rotation
from expert.mechanics import ExternalContact, external_contacts, required_wrench, wrench_about
from expert.problems.contact import SUPPORT, ContactTask
from expert.world.values import IntArray

QP_ITERATIONS = 400


class Model(NamedTuple):
    """What the compiled code reads.  t step, f facet, e ray of the environment, g group of rays, h half-plane.

    origin (2,) [m]: the first centre of mass, zero of all positions.  centre (T, 2); arm (T, F, 2) from the centre of mass to end point a, edge (T, F, 2) = b - a, length (F,);
    normal, tangent (T, F, 2); low, high (T, F): range of rho that margins and walls leave.
    required (T, 3); rays (T, E, 3) wrenches, group (T, E) of each, -1 for none; limit (T, G) of each group's sum.
    walls (W, 3): n.x >= d;  region (T, R, H, 3): a.x <= b, padded with 0.x <= 1.
    friction is the share of true_friction that is planned with; margin_weight times mu lambda_n - |lambda_t| (true mu) is
    the reward for the distance from the cone's edge (beta).
    parking (2,): where a finger that never touches waits; nan: nowhere stays free all the time.
    workspace: free positions are sought within this distance of the origin, per coordinate.
    """

    origin: Array
    centre: Array
    arm: Array
    edge: Array
    length: Array
    normal: Array
    tangent: Array
    low: Array
    high: Array
    required: Array
    rays: Array
    group: IntArray
    limit: Array
    walls: Array
    region: Array
    parking: Array
    friction: float
    true_friction: float
    max_force: float
    min_force: float
    force_weight: float
    acceleration_weight: float
    margin_weight: float
    min_interval: int
    workspace: float
    iterations: int

    @property
    def steps(self) -> int:
        """T."""
        return len(self.required)

    @property
    def facets(self) -> int:
        """F."""
        return len(self.length)


def model_of(task: ContactTask, *, iterations: int = QP_ITERATIONS) -> Model:
    """Scale the task: lengths by L, forces by m g, the cost by 1 / (m g)^2."""
    L, weight = task.body.size, task.weight
    poses = task.trajectory.poses
    origin = poses[0, :2].copy()
    a, b = task.body.facets_w(poses)
    normal, tangent = task.body.frames_w(poses)
    contacts = external_contacts(task)
    low, high = rho_limits(task, a, b)
    rays, group, limit = environment_rays(task, contacts)
    mu = task.robustness.cone_fraction * task.fingers.friction
    unit = np.array([weight, weight, weight * L])
    return Model(
        origin=origin,
        centre=(poses[:, :2] - origin) / L,
        arm=(a - poses[:, None, :2]) / L,
        edge=(b - a) / L,
        length=np.linalg.norm(b[0] - a[0], axis=-1) / L,
        normal=normal,
        tangent=tangent,
        low=low,
        high=high,
        required=required_wrench(task, contacts) / unit,
        rays=rays,
        group=group,
        limit=limit,
        walls=_from(origin, wall_rows(task)) / np.array([1, 1, L]),
        region=_from(origin, region_rows(task)) / np.array([1, 1, L]),
        parking=(parking_place(task) - origin) / L,
        friction=mu,
        true_friction=task.fingers.friction,
        max_force=task.fingers.max_force / weight,
        min_force=task.robustness.min_normal_force / weight,
        force_weight=task.cost.force,
        acceleration_weight=task.cost.acceleration * (L / task.trajectory.dt**2 / weight) ** 2,
        margin_weight=task.cost.margin / weight / np.hypot(1, task.fingers.friction),
        min_interval=task.robustness.min_interval,
        workspace=10.0 + float(np.abs(poses[:, :2] - origin).max()) / L,
        iterations=iterations,
    )


def _from(origin: Array, rows: Array) -> Array:
    """Rows (n, d) of n.x against d, with x counted from `origin`."""
    shifted = rows.copy()
    shifted[..., 2] -= rows[..., :2] @ origin
    return shifted


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


def environment_rays(
    task: ContactTask, contacts: tuple[ExternalContact, ...]
) -> tuple[Array, IntArray, Array]:
    """Wrenches of the rays that walls and support may choose from, their groups and limits; walls in units of m g."""
    L, weight = task.body.size, task.weight
    lists: list[list[tuple[Array, int]]] = [[] for _ in range(task.steps)]
    limits: list[list[float]] = [[] for _ in range(task.steps)]
    for c in contacts:
        if c.fixed:
            continue
        scale, most = (weight, 1.0) if c.wall == SUPPORT else (1.0, c.limit / weight)
        arm = (c.point - task.trajectory.poses[c.step, :2]) / L
        for ray in c.rays / scale:
            lists[c.step].append((wrench_about(ray, arm, np.zeros(2)), len(limits[c.step])))
        limits[c.step].append(most)
    E, G = max(map(len, lists)), max(map(len, limits))
    rays, group = np.zeros((task.steps, E, 3)), np.full((task.steps, E), -1)
    limit = np.zeros((task.steps, G))
    for t, entries in enumerate(lists):
        for e, (ray, g) in enumerate(entries):
            rays[t, e], group[t, e] = ray, g
        limit[t, : len(limits[t])] = limits[t]
    return rays, group, limit


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
