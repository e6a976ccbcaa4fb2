"""A contact task as arrays without dimension, which all methods read: length L (object size), force m g, torque m g L."""

from typing import NamedTuple

import numpy as np

from expert.geometry.pose import Array
from expert.mechanics import (
    ExternalContact,
    external_contacts,
    friction_rays,
    parking_place,
    region_rows,
    required_wrench,
    rho_limits,
    wall_rows,
    workspace,
    wrench_about,
)
from expert.problems.contact import SUPPORT, ContactTask
from expert.world.values import IntArray

QP_ITERATIONS = 400
"""Changes of the active set after which the compiled QP solver hands over to others."""


FREE_FORCES = 1e4
"""Weight of squared accelerations where forces cost nothing."""


class ScaledTask(NamedTuple):
    """Data of Thesis 3.1.2 for models and compiled code.  t step, f facet, e ray of the environment, g group of rays, h half-plane.

    origin (2,) [m]: the first centre of mass, zero of all positions; length L [m], weight m g [N].
    centre (T, 2); arm (T, F, 2) from the centre of mass to end point a, edge (T, F, 2) = b - a, lengths (F,);
    normal, tangent (T, F, 2); low, high (T, F): range of rho that margins and walls leave.
    required (T, 3): wrench that fingers and reactions together exert; rays (T, E, 3) wrenches of the environment, group (T, E) of each,
    -1 for none; limit (T, G) of each group's sum.
    walls (W, 3): n.x >= d;  region (T, R, H, 3): a.x <= b, padded with 0.x <= 1.
    cost_unit: cost [SI] of a unit; forces weigh 1, or accelerations FREE_FORCES where forces cost nothing.
    friction is the share of true_friction that is planned with; margin_weight times mu lambda_n - |lambda_t| (true mu) is
    the reward for the distance from the cone's edge (beta).
    parking (2,): where a finger that never touches waits; nan: nowhere stays free all the time.
    workspace (2, d): the box of finger positions.
    """

    origin: Array
    size: float
    weight: float
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
    cost_unit: float
    force_weight: float
    acceleration_weight: float
    margin_weight: float
    min_interval: int
    workspace: Array
    iterations: int

    @classmethod
    def of(cls, task: ContactTask) -> "ScaledTask":
        """Scale the task: lengths by L, forces by m g."""
        L, weight = task.body.size, task.weight
        poses = task.trajectory.poses
        origin = poses[0, :2].copy()
        a, b = task.body.facets_w(poses)
        normal, tangent = task.body.frames_w(poses)
        contacts = external_contacts(task)
        low, high = rho_limits(task, a, b)
        rays, group, limit = environment_rays(task, contacts)
        mu = task.fingers.friction
        return cls(
            origin=origin,
            size=L,
            weight=weight,
            centre=(poses[:, :2] - origin) / L,
            arm=(a - poses[:, None, :2]) / L,
            edge=(b - a) / L,
            length=np.linalg.norm(b[0] - a[0], axis=-1) / L,
            normal=normal,
            tangent=tangent,
            low=low,
            high=high,
            required=required_wrench(task, contacts) / [weight, weight, weight * L],
            rays=rays,
            group=group,
            limit=limit,
            walls=_from(origin, wall_rows(task)) / [1, 1, L],
            region=_from(origin, region_rows(task)) / [1, 1, L],
            parking=(parking_place(task) - origin) / L,
            friction=task.robustness.cone_fraction * mu,
            true_friction=mu,
            max_force=task.fingers.max_force / weight,
            min_force=task.robustness.min_normal_force / weight,
            **_cost_weights(task),
            min_interval=task.robustness.min_interval,
            workspace=(workspace(task) - origin) / L,
            iterations=QP_ITERATIONS,
        )

    @property
    def steps(self) -> int:
        """T."""
        return len(self.required)

    @property
    def facets(self) -> int:
        """F."""
        return len(self.length)

    @property
    def regions(self) -> int:
        """R."""
        return self.region.shape[1]


def _cost_weights(task: ContactTask) -> dict[str, float]:
    """Unit of cost and weights of forces, accelerations and distances from the cones' edges (Thesis 3.1.4)."""
    unit = cost_unit(task)
    per_length = task.body.size / task.trajectory.dt**2
    return {
        "cost_unit": unit,
        "force_weight": task.cost.force * task.weight**2 / unit,
        "acceleration_weight": task.cost.acceleration * per_length**2 / unit,
        "margin_weight": task.cost.margin * task.weight / unit / np.hypot(1, task.fingers.friction),
    }


def cost_unit(task: ContactTask) -> float:
    """Cost [SI] that counts as 1: numbers of ordinary size, whatever the weights' common factor."""
    if task.cost.force > 0:
        return task.cost.force * task.weight**2
    if task.cost.acceleration > 0:
        return task.cost.acceleration * (task.body.size / task.trajectory.dt**2) ** 2 / FREE_FORCES
    return task.weight**2


def _from(origin: Array, rows: Array) -> Array:
    """Rows (n, d) of n.x against d, with x counted from `origin`."""
    shifted = rows.copy()
    shifted[..., 2] -= rows[..., :2] @ origin
    return shifted


def environment_rays(
    task: ContactTask, contacts: tuple[ExternalContact, ...]
) -> tuple[Array, IntArray, Array]:
    """Wrenches of the rays that walls and support may choose from, their groups and limits; walls in units of m g (3-CT6)."""
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
    E, G = max(1, *map(len, lists)), max(1, *map(len, limits))
    rays, group = np.zeros((task.steps, E, 3)), np.full((task.steps, E), -1)
    limit = np.zeros((task.steps, G))
    for t, entries in enumerate(lists):
        for e, (ray, g) in enumerate(entries):
            rays[t, e], group[t, e] = ray, g
        limit[t, : len(limits[t])] = limits[t]
    return rays, group, limit


def finger_rays(scaled: ScaledTask) -> Array:
    """Edges (T, F, 2 rays, d) of the fingers' cones, of unit normal component (3-CT3)."""
    return friction_rays(scaled.normal, scaled.friction)


def end_points(scaled: ScaledTask) -> Array:
    """Facets' end points relative to the centre of mass, (T, F, j, d)."""
    return np.stack([scaled.arm, scaled.arm + scaled.edge], axis=2)


def belonging(scaled: ScaledTask) -> Array:
    """1 where a ray of the environment belongs to a group, (T, E, G)."""
    return (scaled.group[..., None] == np.arange(scaled.limit.shape[1])).astype(float)
