"""Polished plans are stationary: each is the minimiser of its own convex program, written out again in cvxpy."""

from dataclasses import replace

import cvxpy as cp
import numpy as np
import pytest

from expert.contact import solve
from expert.geometry.convex import Region, free_regions
from expert.geometry.pose import Array, cross, rotation
from expert.mechanics import external_contacts, friction_rays, required_wrench, wrench_about
from expert.problems.contact import FREE, ContactTask, Plan, Robustness
from tests.support.random_tasks import floor_task, table_task

ROBUST = Robustness(
    cone_fraction=0.7, support_inset=0.3, min_normal_force=0.04, min_interval=2, free_clearance=0.005
)


def first_order_minimiser(task: ContactTask, plan: Plan) -> tuple[Array, Array]:
    """Positions [m] and forces [N] that minimise the cost at the plan's modes, torque to first order at the plan."""
    T, C = plan.modes.shape
    L, weight = task.body.size, task.weight
    contacts = external_contacts(task)
    p, force = cp.Variable((T * C, 2)), cp.Variable((T * C, 2))  # in L and m g
    p0, force0 = plan.positions.reshape(-1, 2) / L, plan.forces.reshape(-1, 2) / weight
    rows: list = []
    required = required_wrench(task, contacts) / [weight, weight, weight * L]
    a, b = (x / L for x in task.body.facets_w(task.trajectory.poses))
    normal, _ = task.body.frames_w(task.trajectory.poses)
    margin, mu = task.fingers.facet_margin, task.robustness.cone_fraction * task.fingers.friction
    rho: dict = {}
    for t in range(T):
        centre = task.trajectory.poses[t, :2] / L
        balance = -required[t]
        for c in range(C):
            i, f = t * C + c, int(plan.modes[t, c])
            arm = p0[i] - centre
            balance = balance + cp.hstack(
                [
                    force[i, 0],
                    force[i, 1],
                    arm[0] * force[i, 1]
                    - arm[1] * force[i, 0]
                    + (p[i, 0] - p0[i, 0]) * force0[i, 1]
                    - (p[i, 1] - p0[i, 1]) * force0[i, 0],
                ]
            )
            if f == FREE:
                rows += [force[i] == 0, *outside(task, t, p[i] * L, p0[i] * L)]
                continue
            start = t
            while start > 0 and plan.modes[start - 1, c] == f:
                start -= 1
            share = rho.setdefault((c, start), cp.Variable())
            rows += [p[i] == a[t, f] + share * (b[t, f] - a[t, f]), share >= margin, share <= 1 - margin]
            rows += [
                w.normal @ (p[i] * L - w.point) >= task.fingers.clearance for w in task.environment.walls
            ]
            if t < T - 1 and plan.modes[t + 1, c] != f:
                rows.append(force[i] == 0)
                continue
            rays = cp.Variable(2, nonneg=True)
            rows += [
                force[i] == rays @ friction_rays(normal[t, f], mu),
                cp.sum(rays) <= task.fingers.max_force / weight,
                cp.sum(rays) >= task.robustness.min_normal_force / weight,
            ]
        for contact in contacts:
            if contact.step == t and not contact.fixed:
                weights = cp.Variable(len(contact.rays), nonneg=True)
                unit = wrench_about(contact.rays, contact.point / L, centre)
                on_wall = contact.wall >= 0
                balance = balance + weights @ (unit if on_wall else unit / weight)
        rows.append(balance == 0)
    q = [p[t * C : (t + 1) * C] for t in range(T)]
    rate = (L / task.trajectory.dt**2 / weight) ** 2
    smooth = sum(cp.sum_squares(q[t] - 2 * q[t - 1] + q[t - 2]) for t in range(2, T))
    held = cp.sum_squares(p - p0)  # flat directions
    cp.Problem(cp.Minimize(cp.sum_squares(force) + rate * smooth + 1e-6 * rate * held), rows).solve(
        solver=cp.CLARABEL, tol_gap_abs=1e-12, tol_gap_rel=1e-12, tol_feas=1e-12
    )
    return p.value.reshape(T, C, 2) * L, force.value.reshape(T, C, 2) * weight


def outside(task: ContactTask, t: int, x: cp.Expression, x0: Array) -> list:
    """The free region that holds x0 most deeply, and the walls."""
    turn, centre = rotation(task.trajectory.poses[t, 2]), task.trajectory.poses[t, :2]
    regions = [
        Region(r.A @ turn.T, r.b + r.A @ turn.T @ centre)
        for r in free_regions(task.body.vertices, task.robustness.free_clearance)
    ]
    best = max(regions, key=lambda r: float((r.b - r.A @ x0).min()))
    walls = [w.normal @ (x - w.point) >= task.fingers.clearance for w in task.environment.walls]
    return [best.A @ x <= best.b, *walls]


@pytest.mark.parametrize("seed", range(12))
def test_a_polished_plan_is_the_optimum_of_its_own_convex_program(seed: int) -> None:
    rng = np.random.default_rng(seed)
    task = floor_task(rng, steps=5, robustness=ROBUST) if seed % 3 else table_task(rng)
    plan = solve(task)
    if not plan.found:
        pytest.skip("no plan to polish")
    positions, forces = first_order_minimiser(task, plan)
    touching = plan.modes != FREE
    assert np.abs(positions - plan.positions)[touching].max(initial=0.0) < 5e-6  # flat: 1e-6 of curvature
    assert np.abs(forces - plan.forces).max() < 1e-6


def test_polishing_never_raises_the_cost_and_keeps_the_modes() -> None:
    for seed in (1, 5, 9):
        task = floor_task(np.random.default_rng(seed))
        rough, fine = solve(task, polish=False), solve(task)
        assert fine.objective <= rough.objective * (1 + 1e-9)
        np.testing.assert_array_equal(fine.modes, rough.modes)


def test_torque_of_a_polished_plan_is_exact() -> None:
    task = replace(floor_task(np.random.default_rng(9)), robustness=ROBUST)
    plan = solve(task)
    arms = plan.positions - task.trajectory.poses[:, None, :2]
    torque = cross(arms, plan.forces).sum(axis=1)
    for c in plan.contact_forces:
        torque[c.step] += cross(c.point - task.trajectory.poses[c.step, :2], c.force)
    needed = task.body.inertia * task.trajectory.accelerations[:, 2]
    np.testing.assert_allclose(torque, needed, atol=1e-9)
