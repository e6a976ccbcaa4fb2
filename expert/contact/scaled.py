"""A contact task in units of the object's size L, its weight m g and m g L, as arrays for the mixed-integer models."""

from dataclasses import dataclass

import numpy as np

from expert.geometry.convex import free_regions
from expert.geometry.pose import Array, rotation, to_world
from expert.mechanics import ExternalContact, external_contacts, friction_rays, required_wrench, wrench_about
from expert.problems.contact import ContactTask


@dataclass(frozen=True, kw_only=True)
class ScaledTask:
    """Dimensionless data of Thesis 3.1.2.  Indices: t step, c finger, f facet, j end point, k ray, r region, h side.

    centres (t, d); levers (t, f, j, d): facet end points relative to the centre of mass; rays (t, f, k, d) with unit
    normal component; required (t, 3): wrench that fingers and reactions together exert; reactions (t, 3, i): wrench of environment
    ray i, scaled to unit length; reaction_rows (e, i), reaction_limits (e,): limits on the sum over each contact.
    region_A (t, r, h, d), region_b (t, r, h): free space A p <= b with clearance; wall_A (w, d), wall_b (w,): for every
    finger.  workspace (2, d): the box of finger positions.  Costs are in (m g)^2.
    """

    length: float
    weight: float
    centres: Array
    levers: Array
    rays: Array
    required: Array
    contacts: tuple[ExternalContact, ...]
    reactions: Array
    reaction_rows: Array
    reaction_limits: Array
    region_A: Array
    region_b: Array
    wall_A: Array
    wall_b: Array
    workspace: Array
    max_force: float
    min_force: float
    force_cost: float
    acceleration_cost: float
    margin_cost: float

    @property
    def shape(self) -> tuple[int, int, int]:
        """Steps T, facets F, regions R."""
        return len(self.centres), self.levers.shape[1], self.region_A.shape[1]

    @classmethod
    def of(cls, task: ContactTask) -> "ScaledTask":
        """Scale a task."""
        L, weight = task.body.size, task.weight
        q = task.trajectory.poses
        everything = external_contacts(task)
        contacts = tuple(c for c in everything if not c.fixed and c.rays.any())
        region_A, region_b = _regions(task)
        walls = task.environment.walls
        wall_A = np.array([-w.normal for w in walls]).reshape(-1, 2)
        wall_b = np.array([-(w.normal @ w.point) - task.fingers.clearance for w in walls])
        normal, _ = task.body.frames_w(q)
        return cls(
            length=L,
            weight=weight,
            centres=q[:, :2] / L,
            levers=(np.stack(task.body.facets_w(q), axis=2) - q[:, None, None, :2]) / L,
            rays=friction_rays(normal, task.robustness.cone_fraction * task.fingers.friction),
            required=required_wrench(task, everything) / [weight, weight, weight * L],
            contacts=contacts,
            **_reactions(task, contacts),
            region_A=region_A,
            region_b=region_b / L,
            wall_A=wall_A,
            wall_b=wall_b / L,
            workspace=_workspace(task) / L,
            max_force=task.fingers.max_force / weight,
            min_force=task.robustness.min_normal_force / weight,
            force_cost=task.cost.force,
            acceleration_cost=task.cost.acceleration * (L / task.trajectory.dt**2 / weight) ** 2,
            margin_cost=task.cost.margin / weight,
        )


def _reactions(task: ContactTask, contacts: tuple[ExternalContact, ...]) -> dict[str, Array]:
    """Wrenches of all environment rays, scaled to unit length; which contact each belongs to; the contacts' limits."""
    q = task.trajectory.poses
    count = max(1, sum(len(c.rays) for c in contacts))  # without contacts: one ray that can exert nothing
    wrenches, rows = np.zeros((task.steps, 3, count)), np.zeros((max(1, len(contacts)), count))
    limits = np.zeros(len(rows))
    arm = np.array([1.0, 1.0, task.body.size])
    first = 0
    for e, c in enumerate(contacts):
        columns = slice(first, first := first + len(c.rays))
        wrenches[c.step, :, columns] = (wrench_about(c.rays / ray_size(c), c.point, q[c.step, :2]) / arm).T
        rows[e, columns], limits[e] = 1.0, c.limit * ray_size(c) / task.weight
    return {"reactions": wrenches, "reaction_rows": rows, "reaction_limits": limits}


def ray_size(contact: ExternalContact) -> float:
    """Length of the longest ray: near 1 for walls, [N] for the support plane."""
    return float(np.linalg.norm(contact.rays, axis=1).max())


def _regions(task: ContactTask) -> tuple[Array, Array]:
    """Free space (t, r, h, d), (t, r, h) [m] around the object, grown by the clearance, and clear of walls.

    Sides are padded with 0 p <= 1.
    """
    regions = free_regions(task.body.vertices, task.robustness.free_clearance)
    sides = max(len(r.b) for r in regions)
    A_b, b_b = np.zeros((len(regions), sides, 2)), np.ones((len(regions), sides))
    for k, region in enumerate(regions):
        A_b[k, : len(region.b)], b_b[k, : len(region.b)] = region.A, region.b
    q = task.trajectory.poses
    turn = rotation(q[:, 2])
    A = np.einsum("tde,rhe->trhd", turn, A_b)
    return A, b_b + np.einsum("trhd,td->trh", A, q[:, :2])


def _workspace(task: ContactTask) -> Array:
    """Box (2, d) [m] for finger positions: what the object sweeps, and beyond it the reach of a finger that
    leaves at the speed of the fastest vertex and is never slowed down (more would cost acceleration for nothing)."""
    vertices = to_world(task.trajectory.poses, task.body.vertices)
    fastest = np.linalg.norm(np.diff(vertices, axis=0), axis=2).max()
    reach = (
        task.body.size + task.steps * fastest + max(task.fingers.clearance, task.robustness.free_clearance)
    )
    return np.stack([vertices.min(axis=(0, 1)) - reach, vertices.max(axis=(0, 1)) + reach])
