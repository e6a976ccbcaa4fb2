"""4-CT6 as a disciplined parametrised program: one function per constraint, without dimensions, without a solver."""

from dataclasses import dataclass, fields

import cvxpy as cp

from dlm.inverse_dynamics.data import QPSize, QPWeights

Parameters = dict[str, cp.Parameter]


@dataclass(frozen=True, kw_only=True)
class Variables:
    """Unknowns; t step, c finger, e ground contact, k ray, d coordinate.

    p, lam (t, c, d): finger positions and forces.  alpha (t, c, k), beta (t, e, k): weights of the rays of fingers and ground.
    rho (t, c): place on the facet.  away (t, c, d), slip (t - 1, c): what contact and stick flags below 1 allow.
    eps (t, 3): wrench without a source.  out (t, c): how far a finger is out of its region.
    """

    p: cp.Variable
    lam: cp.Variable
    alpha: cp.Variable
    beta: cp.Variable
    rho: cp.Variable
    away: cp.Variable
    slip: cp.Variable
    eps: cp.Variable
    out: cp.Variable

    @classmethod
    def of(cls, size: QPSize) -> "Variables":
        """Fresh variables."""
        t, c, e = size.steps, size.fingers, size.external
        shapes = {
            "p": (t, c, 2),
            "lam": (t, c, 2),
            "alpha": (t, c, 2),
            "beta": (t, e, 2),
            "rho": (t, c),
            "away": (t, c, 2),
            "slip": (t - 1, c),
            "eps": (t, 3),
            "out": (t, c),
        }
        return cls(**{name: cp.Variable(shape, name=name) for name, shape in shapes.items()})

    def all(self) -> list[cp.Variable]:
        """In the order of the fields."""
        return [getattr(self, f.name) for f in fields(self)]


def inverse_dynamics_problem(size: QPSize, weights: QPWeights) -> tuple[cp.Problem, Parameters, Variables]:
    """QP (4-CT6), which is ID (4-CT1, 4-CT2) made convex: the problem, its parameters by the names of QPData, its variables."""
    x = Variables.of(size)
    P = {name: cp.Parameter(shape, name=name) for name, shape in size.shapes.items()}
    constraints = [
        *force_balance(x, P),
        *torque_balance(x, P),
        *friction_cones(x, P),
        *contact_facets(x, P),
        *sticking(x, P),
        *free_regions(x, P),
        *([] if weights.slack is not None else [x.eps == 0, x.out == 0]),
    ]
    return cp.Problem(cp.Minimize(cost(x, P, weights)), constraints), P, x


def force_balance(x: Variables, P: Parameters) -> list[cp.Constraint]:
    """M r_ddot + G = J^T Lambda + eps, the two rows of forces."""
    ground = cp.sum(combine(P["ground_rays"], x.beta), axis=1)
    return [cp.sum(x.lam, axis=1) + ground + x.eps[:, :2] == P["wrench"][:, :2]]


def torque_balance(x: Variables, P: Parameters) -> list[cp.Constraint]:
    """Third row, with torque = (p_ref - r) x lambda + (p - p_ref) x lambda_ref, exact to first order at (p_ref, lambda_ref)."""
    fingers = cp.sum(cross(P["arm"], x.lam) - cross(P["couple"], x.p), axis=1) - P["offset"]
    ground = cp.sum(cp.multiply(P["ground_torque"], x.beta), axis=(1, 2))
    return [fingers + ground + x.eps[:, 2] == P["wrench"][:, 2]]


def friction_cones(x: Variables, P: Parameters) -> list[cp.Constraint]:
    """lambda_c in FC_c with bounded normal force, lambda_e in FC_e.  Zero rays let a finger that must not push keep any alpha."""
    normal = cp.sum(x.alpha, axis=2)
    cone = [x.lam == combine(P["rays"], x.alpha), x.alpha >= 0, x.beta >= 0]
    return [*cone, normal >= P["least"], normal <= P["most"]]


def contact_facets(x: Variables, P: Parameters) -> list[cp.Constraint]:
    """p_c in F_c: on the facet where contact = 1, anywhere where contact = 0 (`away` costs contact^2)."""
    along = [P["start"][:, :, d] + cp.multiply(P["edge"][:, :, d], x.rho) for d in (0, 1)]
    off = [cp.multiply(P["free"], x.away[:, :, d]) for d in (0, 1)]
    return [*(x.p[:, :, d] == along[d] + off[d] for d in (0, 1)), x.rho >= 0, x.rho <= 1]


def sticking(x: Variables, P: Parameters) -> list[cp.Constraint]:
    """3-CT5: rho stays the same where stick = 1 (`slip` costs stick^2)."""
    return [x.rho[1:] - x.rho[:-1] == cp.multiply(P["slips"], x.slip)]


def free_regions(x: Variables, P: Parameters) -> list[cp.Constraint]:
    """3-CT7: A p <= b for free fingers."""
    rows = P["bounds"].shape[2]
    beyond = [_dot(P["normals"][:, :, h], x.p) - P["bounds"][:, :, h] for h in range(rows)]
    return [*(depth <= x.out for depth in beyond), x.out >= 0]


def cost(x: Variables, P: Parameters, w: QPWeights) -> cp.Expression:
    """|Lambda|^2_Q + |p_ddot|^2_Q (4-CT1) + q |eps|_1, the price of flags below 1, and what makes the optimum unique."""
    squares = [
        (w.force, x.lam),
        (w.acceleration, x.p[2:] - 2 * x.p[1:-1] + x.p[:-2]),
        (w.hold, _weigh(P["contact"], x.away)),
        (w.hold, cp.multiply(P["sticks"], x.slip)),
        (w.filler, _weigh(P["idle"], x.alpha)),
        (w.filler, _weigh(P["absent"], x.beta - 0.5)),
        (w.filler, cp.multiply(P["free"], x.rho - 0.5)),
        (w.anchor, x.p - P["anchor"]),
        (w.ridge, x.beta),
    ]
    # One norm instead of nine: the cone program has one second-order cone then.
    total = cp.sum_squares(cp.hstack([weight**0.5 * cp.vec(term, order="C") for weight, term in squares]))
    slack = 0 if w.slack is None else w.slack * cp.sum(cp.abs(x.eps)) + w.out * cp.sum(x.out)
    return total + slack


def combine(rays: cp.Parameter, weights: cp.Variable) -> cp.Expression:
    """sum_k weights[., ., k] rays[., ., k, d], shape (., ., d)."""
    parts = [sum(cp.multiply(rays[:, :, k, d], weights[:, :, k]) for k in (0, 1)) for d in (0, 1)]
    return cp.stack(parts, axis=2)


def cross(u: cp.Expression, v: cp.Expression) -> cp.Expression:
    """Planar cross product over the last axis."""
    return cp.multiply(u[:, :, 0], v[:, :, 1]) - cp.multiply(u[:, :, 1], v[:, :, 0])


def _dot(u: cp.Expression, v: cp.Expression) -> cp.Expression:
    return cp.multiply(u[:, :, 0], v[:, :, 0]) + cp.multiply(u[:, :, 1], v[:, :, 1])


def _weigh(flag: cp.Parameter, vectors: cp.Expression) -> cp.Expression:
    return cp.stack([cp.multiply(flag, vectors[:, :, d]) for d in (0, 1)], axis=2)
