"""Exact plans put into the variables of MIQP1: what every block must accept."""

import cvxpy as cp
import numpy as np
from scipy.optimize import nnls

from expert.contact.scaled import ScaledTask, end_points, finger_rays
from expert.contact.thesis_blocks import Variables, torque_cells
from expert.mechanics import external_contacts
from expert.problems.contact import FREE, SUPPORT, ContactTask, Plan


def assign(x: Variables, task: ContactTask, s: ScaledTask, plan: Plan) -> None:
    """Values of all variables at an exact plan; tau is the true product, beta the true distance."""
    p, lam = (plan.positions - s.origin) / s.size, plan.forces / s.weight
    assigned = np.eye(s.facets + 1)[plan.modes][..., :-1]  # FREE selects the last, dropped column
    x.p.save_value(p)
    x.lam.save_value(lam)
    lever = (p - s.centre[:, None]) * (plan.modes != FREE)[..., None]
    x.tau.save_value(lever * lam[..., ::-1])
    x.T.save_value(assigned)
    x.rho.save_value(_facet_weights(p, s, assigned))
    x.alpha.save_value(_cone_weights(lam, s, assigned))
    x.alpha_e.save_value(_reactions(plan, task, s))
    x.R.save_value(_regions(p, s, plan.modes))
    normal = x.alpha.value.sum(axis=(2, 3))
    mu, planned = task.fingers.friction, task.fingers.friction * task.robustness.cone_fraction
    tangential = planned * np.abs(np.sum(x.alpha.value[..., 0] - x.alpha.value[..., 1], axis=2))
    x.beta.save_value((mu * normal - tangential) / np.hypot(1, mu))


def _facet_weights(p: np.ndarray, s: ScaledTask, assigned: np.ndarray) -> np.ndarray:
    a, b = (
        end_points(s)[:, None, :, 0] + s.centre[:, None, None],
        end_points(s)[:, None, :, 1] + s.centre[:, None, None],
    )
    along = np.sum((p[:, :, None] - a) * (b - a), axis=-1) / np.sum((b - a) ** 2, axis=-1)
    return np.stack([1 - along, along], axis=-1) * assigned[..., None]


def _cone_weights(lam: np.ndarray, s: ScaledTask, assigned: np.ndarray) -> np.ndarray:
    """alpha with alpha_+ ray_+ + alpha_- ray_- = lam on the assigned facet."""
    rays = np.swapaxes(finger_rays(s), -1, -2)[:, None] * np.ones((1, lam.shape[1], 1, 1, 1))
    weights = np.linalg.solve(rays, np.broadcast_to(lam[:, :, None, :, None], (*rays.shape[:-1], 1)))
    return weights[..., 0] * assigned[..., None]


def _reactions(plan: Plan, task: ContactTask, s: ScaledTask) -> np.ndarray:
    """Weights (T, E) of the environment's rays, those of each contact in turn."""
    given = {(c.step, c.wall, c.vertex): c.force for c in plan.contact_forces}
    weights, used = np.zeros(s.group.shape), np.zeros(s.steps, dtype=int)
    for c in external_contacts(task):
        if not c.fixed:
            force = given.get((c.step, c.wall, c.vertex), np.zeros(2))
            unit = 1.0 if c.wall == SUPPORT else s.weight
            rays = slice(used[c.step], used[c.step] + len(c.rays))
            weights[c.step, rays] = nnls(unit * c.rays.T, force)[0]
            used[c.step] = rays.stop
    return weights


def _regions(p: np.ndarray, s: ScaledTask, modes: np.ndarray) -> np.ndarray:
    """The region that holds each free finger with the most room."""
    depth = np.max(np.einsum("tcd,trhd->tcrh", p, s.region[..., :2]) - s.region[:, None, ..., 2], axis=-1)
    return np.eye(s.regions)[depth.argmin(axis=2)] * (modes == FREE)[..., None]


def assign_cells(x: Variables, s: ScaledTask, segments: int, copies: dict[str, cp.Variable]) -> None:
    """W and its copies u_k, v_k for the lever arms and forces that the other variables hold."""
    cells = torque_cells(s, segments)
    u = np.einsum("tcfj,tfjd->tcd", x.rho.value, end_points(s))[..., None]
    v = x.lam.value[..., ::-1][..., None]
    slack = 1e-9
    inside = (cells.u_low - slack <= u) & (u <= cells.u_high + slack)
    inside &= (cells.v_low - slack <= v) & (v <= cells.v_high + slack)
    touching = x.T.value.sum(axis=2)[..., None, None]
    x.W.save_value(np.eye(len(cells))[inside.argmax(axis=-1)] * touching)
    for name, value in (("u_k", u), ("v_k", v)):
        copies[name].save_value(value * x.W.value)
