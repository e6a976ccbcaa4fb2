"""The numbers of the quadratic program 4-CT6, without dimensions, from mechanical parameters in SI units."""

from dataclasses import dataclass
from typing import Annotated

import torch
from torch import Tensor

from dlm.inverse_dynamics.parameters import ParameterBatch
from expert.problems.contact import Cost
from expert.world.values import require


@dataclass(frozen=True, kw_only=True)
class QPSize:
    """Numbers of steps, fingers, region rows of a finger and ground contacts."""

    steps: int = 5
    fingers: int = 2
    rows: int = 4
    external: int = 2

    def __post_init__(self) -> None:
        require(self.steps >= 3, "steps", "at least 3, for accelerations", self.steps)

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shape of each field of QPData, without its batch axis."""
        t, c, h, e = self.steps, self.fingers, self.rows, self.external
        sizes = {"t": t, "s": t - 1, "c": c, "h": h, "e": e, "w": 3, "k": 2, "d": 2}
        return {name: tuple(sizes[axis] for axis in axes) for name, axes in QP_AXES.items()}


@dataclass(frozen=True, kw_only=True)
class QPData:
    """Parameters of one batch of programs; lengths over L, forces over F, torques over F L.

    Axes after the batch's: t step, s from a step to the next, c finger, e ground contact, h region row, k ray, d x and y, w wrench.
    wrench: what all contacts exert.  arm, couple, anchor, offset: p_ref - r, lambda_ref, p_ref, sum_c p_ref x lambda_ref.
    rays: of the fingers; zero where one must not push.  ground_rays, ground_torque: of the ground; zero without contact.
    start, edge: facets start + rho edge.  contact, free = 1 - contact, idle = 1 - stick, sticks, slips = 1 - sticks, absent: flags.
    least, most: normal forces.  normals, bounds: regions A p <= b.
    """

    wrench: Annotated[Tensor, "tw"]
    arm: Annotated[Tensor, "tcd"]
    couple: Annotated[Tensor, "tcd"]
    anchor: Annotated[Tensor, "tcd"]
    offset: Annotated[Tensor, "t"]
    rays: Annotated[Tensor, "tckd"]
    ground_rays: Annotated[Tensor, "tekd"]
    ground_torque: Annotated[Tensor, "tek"]
    start: Annotated[Tensor, "tcd"]
    edge: Annotated[Tensor, "tcd"]
    contact: Annotated[Tensor, "tc"]
    free: Annotated[Tensor, "tc"]
    idle: Annotated[Tensor, "tc"]
    absent: Annotated[Tensor, "te"]
    sticks: Annotated[Tensor, "sc"]
    slips: Annotated[Tensor, "sc"]
    least: Annotated[Tensor, "tc"]
    most: Annotated[Tensor, "tc"]
    normals: Annotated[Tensor, "tchd"]
    bounds: Annotated[Tensor, "tch"]

    def tensors(self) -> dict[str, Tensor]:
        """All fields by name, in the order of `QPSize.shapes`."""
        return {name: getattr(self, name) for name in QP_AXES}


QP_AXES: dict[str, str] = {name: kind.__metadata__[0] for name, kind in QPData.__annotations__.items()}
"""Axes of every field, without the batch axis."""


@dataclass(frozen=True, kw_only=True)
class QPWeights:
    """Weights of the cost, without dimensions.

    force, acceleration: of |lambda|^2 and |second difference of p|^2.  slack: q of 4-CT6 (None: eps = 0).  out: of leaving a region.
    hold: of leaving the facet or slipping on it, where a flag is below 1.  anchor: of |p - p_ref|^2, against flat directions
    (it vanishes at the expert's plan).  ridge: of ray weights, against opposing rays.
    """

    force: float
    acceleration: float
    slack: float | None
    out: float
    hold: float
    anchor: float
    ridge: float
    filler: float

    @classmethod
    def of(cls, cost: Cost, *, dt: float, length: float, force: float, slack: float | None) -> "QPWeights":
        """The expert's cost over F^2.  Raises InvalidProblem for costs without a unique optimum, or with a cone margin."""
        require(cost.force > 0, "cost.force", "a positive number", cost.force)
        require(cost.acceleration > 0, "cost.acceleration", "a positive number", cost.acceleration)
        require(cost.margin == 0, "cost.margin", "0", cost.margin, "the QP has no reward for cone margins")
        acceleration = cost.acceleration * (length / dt**2) ** 2 / force**2
        return cls(
            force=cost.force,
            acceleration=acceleration,
            slack=slack,
            out=100 * acceleration,
            hold=acceleration,
            anchor=1e-2 * acceleration,
            ridge=1e-6 * cost.force,
            filler=1.0,
        )


def cross(u: Tensor, v: Tensor) -> Tensor:
    """Planar cross product over the last axis."""
    return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]


def qp_data(parameters: ParameterBatch, *, length: float, force: float, couple: bool) -> QPData:
    """Data of 4-CT6.  couple: expand the torque about (p_ref, lambda_ref); otherwise only p_ref x lambda, as printed."""
    P, L, F = parameters, length, force
    centre = P.poses[..., None, :2] / L
    position, reference = P.reference_positions / L, P.reference_forces / F * float(couple)
    contact, stick = P.contact.clamp(0, 1), P.stick.clamp(0, 1)
    most = (P.force_limits[..., 1] / F).clamp(min=0)
    present = P.external_contact.clamp(0, 1)
    ground = P.external_cones * present[..., None, None]
    return QPData(
        wrench=P.wrench / P.wrench.new_tensor([F, F, F * L]),
        arm=position - centre,
        couple=reference,
        anchor=position,
        offset=cross(position, reference).sum(-1),
        rays=P.cones * stick[..., None, None],
        ground_rays=ground,
        ground_torque=cross((P.external_points / L - centre)[..., None, :], ground),
        start=P.facets[..., 0, :] / L,
        edge=(P.facets[..., 1, :] - P.facets[..., 0, :]) / L,
        contact=contact,
        free=1 - contact,
        idle=1 - stick,
        absent=1 - present,
        sticks=stick[:, :-1],
        slips=1 - stick[:, :-1],
        least=torch.minimum((P.force_limits[..., 0] / F).clamp(min=0), most),
        most=most,
        normals=P.region_normals,
        bounds=P.region_offsets / L,
    )
