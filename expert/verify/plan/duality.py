r"""Lower bounds on the cost of contact plans by weak duality: any multipliers will do, good ones give good bounds.

Lengths are measured over L, forces over m g, costs over a unit; positions from the first centre of mass.  The cost of a plan is

    sum_t sum_c cost(lambda) + w sum |p''|^2,    cost(lambda) = W |lambda|^2 - beta (distance from the cone's edge),

p'' second differences.  With multipliers y_t of the wrench balance and any accelerations a, since |p''|^2 >= 2 a.p'' - |a|^2,

    cost >= sum_t (y_t.required - max_environment y_t.wrench) - sum_c max (y_t.wrench(lambda) - cost(lambda))
            + sum 2 w a.p'' - w |a|^2.

Positions on a facet, p = p_a + rho (p_b - p_a), enter through rho alone: what depends on it is concave and least at the ends of
its range.  Free positions enter linearly: least at a corner of where the finger may be.  Without costs and accelerations a positive
value proves that there is no plan at all.
"""

from functools import lru_cache

import numpy as np

from expert.geometry.cover import clip
from expert.geometry.pose import Array
from expert.mechanics import external_contacts, region_rows, required_wrench, rho_limits, wall_rows, workspace
from expert.problems.contact import ContactTask

FAR = 10.0
"""Free fingers are looked for within this distance of the box of finger positions [L]."""
FREE_FORCES = 1e4
"""Accelerations of L / dt^2 cost so many units where forces cost nothing."""
ROUNDING = 1e-12
"""Share of the sum of all terms' sizes that is taken off each bound; so much must a proof of impossibility exceed."""


def cost_unit(task: ContactTask) -> float:
    """What certificates measure costs in [SI]: forces of the object's weight, or accelerations where forces cost nothing."""
    if task.cost.force > 0:
        return task.cost.force * task.weight**2
    if task.cost.acceleration > 0:
        return task.cost.acceleration * (task.body.size / task.trajectory.dt**2) ** 2 / FREE_FORCES
    return task.weight**2


class Duality:
    """The terms of such bounds for one task.  t step, f facet; rho in [0, 1] along a facet."""

    def __init__(self, task: ContactTask) -> None:
        L, weight, poses = task.body.size, task.weight, task.trajectory.poses
        a, b = task.body.facets_w(poses)
        self.steps, self.facets = a.shape[:2]
        self.origin, self.L = poses[0, :2], L
        self.start, self.edge = (a - self.origin) / L, (b - a) / L
        self.centre = (poses[:, :2] - self.origin) / L
        self.normal, self.tangent = task.body.frames_w(poses)
        self.low, self.high = rho_limits(task, a, b)
        contacts = external_contacts(task)
        scale = np.array([weight, weight, weight * L])
        self.required = required_wrench(task, contacts) / scale
        self._environment: list[list[tuple[Array, float]]] = [[] for _ in range(self.steps)]
        for c in contacts:
            if not c.fixed:
                arm = c.point - poses[c.step, :2]
                moment = arm[0] * c.rays[:, 1] - arm[1] * c.rays[:, 0]
                self._environment[c.step].append((np.column_stack([c.rays, moment]) / scale, c.limit))
        mu = task.fingers.friction
        self.unit, self.friction, self.true_friction = cost_unit(task), task.robustness.cone_fraction * mu, mu
        self.most, self.least = task.fingers.max_force / weight, task.robustness.min_normal_force / weight
        self.force_weight = task.cost.force * weight**2 / self.unit
        self.smooth_weight = task.cost.acceleration * (L / task.trajectory.dt**2) ** 2 / self.unit
        self.beta = task.cost.margin * weight / np.hypot(1, mu) / self.unit
        self._walls, self._regions = wall_rows(task), region_rows(task)
        self._box = (workspace(task) - self.origin) / L + FAR * np.array([[-1.0], [1.0]])
        self.free_corners = lru_cache(maxsize=None)(self._free_corners)

    @property
    def regions(self) -> int:
        """How many convex sets cover where a free finger may be (3-CT7)."""
        return self._regions.shape[1]

    def balance(self, t: int, y: Array) -> tuple[float, float]:
        """y.required less what the environment can do about it; and the size of the terms."""
        needed = float(self.required[t] @ y)
        given = sum(limit * max(0.0, float((rays @ y).max())) for rays, limit in self._environment[t])
        return needed - given, float(np.abs(self.required[t] * y).sum()) + given

    def gain(self, t: int, f: int, rho: float, y: Array, free_of_cost: bool) -> float:
        """Largest y.wrench(lambda) - cost(lambda) over the cone of a finger at rho; convex in rho."""
        arm = self.place(t, f, rho) - self.centre[t]
        z = np.array([y[0] - y[2] * arm[1], y[1] + y[2] * arm[0]])
        along, across = float(z @ self.normal[t, f]), abs(float(z @ self.tangent[t, f]))
        if free_of_cost:
            slope = along + self.friction * across
            return slope * (self.most if slope > 0 else self.least)
        along, across = along + self.beta * self.true_friction, max(across - self.beta, 0.0)
        w, mu = self.force_weight, self.friction
        best = -np.inf
        for ideal in (self._ratio(along, w), self._ratio(along + mu * across, w * (1 + mu * mu))):
            n = min(max(ideal, self.least), self.most)
            tau = min(self._ratio(across, w), mu * n)
            best = max(best, along * n + across * tau - w * (n * n + tau * tau))
        return best

    def _ratio(self, slope: float, weight: float) -> float:
        """Where slope x - weight x^2 is largest; without a weight, as far as one can go."""
        return slope / (2 * weight) if weight > 0 else (np.inf if slope > 0 else 0.0)

    def place(self, t: int, f: int, rho: float) -> Array:
        """Position (2,) of a finger on a facet."""
        return self.start[t, f] + rho * self.edge[t, f]

    def pulls(self, accelerations: Array) -> Array:
        """Coefficients (T, 2) of one finger's positions in sum 2 w a.p'', accelerations (T - 2, 2)."""
        pull = np.zeros((len(accelerations) + 2, 2))
        for k, share in enumerate((1.0, -2.0, 1.0)):
            pull[k : k + len(accelerations)] += 2 * self.smooth_weight * share * accelerations
        return pull

    def _free_corners(self, t: int, region: int | None) -> Array:
        """Corners (n, 2) of where a free finger may be at a step, in one of the regions or anywhere; none: nowhere."""
        (x, y), (right, top) = self._box
        box = np.array([[x, y], [right, y], [right, top], [x, top]])
        rows = [np.append(-wall[:2], -wall[2]) for wall in self._walls]
        if region is not None:
            rows += [row for row in self._regions[t, region] if row[:2].any()]
        if not rows:
            return box
        table = np.array(rows)
        return clip(box, table[:, :2].copy(), (table[:, 2] - table[:, :2] @ self.origin) / self.L)
