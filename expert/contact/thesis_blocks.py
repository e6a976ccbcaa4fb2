"""MIQP1's blocks, 3-CT1 to 3-CT9, in thesis letters.  Dimensionless; indices as in `ScaledTask`."""

from dataclasses import dataclass

import cvxpy as cp
import numpy as np

from expert.contact.scaled import ScaledTask, belonging, end_points, finger_rays
from expert.mip.block import Block, implies
from expert.mip.mccormick import Cells, piecewise


@dataclass(frozen=True)
class Variables:
    """Table 3.1.  p (t, c, d) positions; lam (t, c, d) forces; tau (t, c, 2): (p_x - q_x) lam_y and (p_y - q_y) lam_x;
    rho (t, c, f, j) facet weights; alpha (t, c, f, k) cone weights; alpha_e (t, e) environment weights;
    T (t, c, f) contact assignment; R (t, c, r) regions; W (t, c, 2, k) envelopes; beta (t, c) distance to the cone's edge.

    T = 1 while the finger touches the facet, the step of its release included.
    """

    p: cp.Variable
    lam: cp.Variable
    tau: cp.Variable
    rho: cp.Variable
    alpha: cp.Variable
    alpha_e: cp.Variable
    T: cp.Variable
    R: cp.Variable
    W: cp.Variable
    beta: cp.Variable

    @classmethod
    def of(cls, s: ScaledTask, fingers: int, segments: int) -> "Variables":
        """Variables with their boxes: workspace, force limit, reaction limit."""
        T, F, R, C = s.steps, s.facets, s.regions, fingers
        low, high = (np.broadcast_to(corner, (T, C, 2)) for corner in s.workspace)
        reaction = np.einsum("teg,tg->te", belonging(s), s.limit)
        return cls(
            p=cp.Variable((T, C, 2), bounds=[low, high], name="p"),
            lam=cp.Variable((T, C, 2), name="lam"),
            tau=cp.Variable((T, C, 2), name="tau"),
            rho=cp.Variable((T, C, F, 2), bounds=[0, 1], name="rho"),
            alpha=cp.Variable((T, C, F, 2), bounds=[0, s.max_force], name="alpha"),
            alpha_e=cp.Variable(reaction.shape, bounds=[np.zeros_like(reaction), reaction], name="alpha_e"),
            T=cp.Variable((T, C, F), boolean=True, name="T"),
            R=cp.Variable((T, C, R), boolean=True, name="R"),
            W=cp.Variable((T, C, 2, 2 * segments), boolean=True, name="W"),
            beta=cp.Variable((T, C), bounds=[0, s.max_force], name="beta"),
        )

    @property
    def touching(self) -> cp.Expression:
        """(t, c): 1 where the finger touches any facet."""
        return cp.sum(self.T, axis=2)


def linear_dynamics(x: Variables, s: ScaledTask) -> Block:
    """3-CT1: m q_ddot = m g + sum_c lam_c + sum_n lam^e_n."""
    reactions = cp.einsum("te,ted->td", x.alpha_e, s.rays[..., :2])
    return Block.of("3-CT1", cp.sum(x.lam, axis=1) + reactions == s.required[:, :2])


def angular_dynamics(x: Variables, s: ScaledTask) -> Block:
    """3-CT2: I theta_ddot = sum_c tau_c + sum_n R v_n x lam^e_n."""
    torque = cp.sum(x.tau[:, :, 0] - x.tau[:, :, 1], axis=1)
    reactions = cp.einsum("te,te->t", x.alpha_e, s.rays[..., 2])
    return Block.of("3-CT2", torque + reactions == s.required[:, 2])


def lever_arm(x: Variables, s: ScaledTask) -> cp.Expression:
    """p_c - q (t, c, d) where the finger touches, else 0: sum_f sum_j rho_j (v^f_j - q)."""
    return cp.einsum("tcfj,tfjd->tcd", x.rho, end_points(s))


def contact_assignment(x: Variables, s: ScaledTask, margin: float) -> Block:
    """3-CT3: T_fc = 1 => p_c = sum_j rho_j v^f_j and lam_c = sum_k alpha_k gamma_fk.

    Weights vanish with T, so that the sums over all facets select the one that is touched: no big-M but for p.
    """
    return Block.of(
        "3-CT3",
        cp.sum(x.rho, axis=3) == x.T,
        x.rho >= margin * x.T[..., None],
        implies(x.touching, x.p == s.centre[:, None] + lever_arm(x, s)),
        x.lam == cp.einsum("tcfk,tfkd->tcd", x.alpha, finger_rays(s)),
    )


def complementarity(x: Variables, s: ScaledTask) -> Block:
    """3-CT4: no force without contact; in contact a normal force from min_force to max_force."""
    normal = cp.sum(x.alpha, axis=3)
    pushing = x.T[:-1] + x.T[1:] - 1
    return Block.of(
        "3-CT4",
        normal <= s.max_force * x.T,
        normal[:-1] >= s.min_force * pushing,
        normal[-1] >= s.min_force * x.T[-1],
    )


def alternated_sticking(x: Variables, s: ScaledTask, min_interval: int) -> Block:
    """3-CT5: whoever pushes at t still touches at t + 1, at the same rho; a finger goes free before it takes another facet."""
    now, later = x.T[:-1], x.T[1:]
    others = cp.sum(later, axis=2, keepdims=True) - later
    parts = [
        cp.sum(x.alpha[:-1], axis=3) <= s.max_force * later,
        now + others <= 1,
        *implies(now + later - 1, x.rho[1:] == x.rho[:-1]),
    ]
    if min_interval == 2:
        parts += [x.T[0] <= x.T[1], x.T[1:-1] <= x.T[:-2] + x.T[2:], x.T[-1] <= x.T[-2]]
    return Block.of("3-CT5", *parts)


def environment_cones(x: Variables, s: ScaledTask) -> Block:
    """3-CT6: lam^e_n = sum_k alpha^e_k gamma^e_nk with alpha^e >= 0, on the edge where the vertex slides."""
    return Block.of("3-CT6", cp.einsum("te,teg->tg", x.alpha_e, belonging(s)) <= s.limit)


def non_penetration(x: Variables, s: ScaledTask) -> Block:
    """3-CT7: R_rc = 1 => A_r p_c <= b_r, one region or one facet per finger; walls bind every finger."""
    place = cp.einsum("tcd,trhd->tcrh", x.p, s.region[..., :2])
    return Block.of(
        "3-CT7",
        cp.sum(x.R, axis=2) + x.touching == 1,
        implies(x.R, place <= s.region[:, None, ..., 2]),
        *([cp.einsum("tcd,wd->tcw", x.p, s.walls[:, :2]) >= s.walls[:, 2]] if len(s.walls) else []),
    )


def torque_envelopes(x: Variables, s: ScaledTask, segments: int) -> Block:
    """3-CT8, 3-CT9: tau in the piecewise McCormick envelopes of (p - q) lam, M segments for each sign of lam."""
    u = lever_arm(x, s)
    v = cp.stack([x.lam[:, :, 1], x.lam[:, :, 0]], axis=2)
    return Block.of("3-CT8, 3-CT9", piecewise(x.tau, u, v, x.W, torque_cells(s, segments)))


def torque_cells(s: ScaledTask, segments: int) -> Cells:
    """Cells over the reach of the object's vertices and of a finger's force."""
    reach = float(np.linalg.norm(end_points(s), axis=-1).max())
    force = s.max_force * float(np.linalg.norm(finger_rays(s), axis=-1).max())
    return Cells.sign_split(reach, force, segments)


def cone_distance(x: Variables, friction: float, planned: float) -> Block:
    """beta (Thesis 3.1.4): beta <= (mu lam_n -+ lam_t) / sqrt(1 + mu^2), full mu, for forces planned within a cone of friction `planned`."""
    normal, tangential = (
        cp.sum(x.alpha, axis=(2, 3)),
        planned * cp.sum(x.alpha[..., 0] - x.alpha[..., 1], axis=2),
    )
    edge = np.hypot(1.0, friction)
    return Block.of("beta", *(edge * x.beta <= friction * normal + sign * tangential for sign in (1, -1)))
