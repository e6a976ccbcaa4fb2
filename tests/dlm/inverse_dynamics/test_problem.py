from dataclasses import replace

import torch
from torch import Tensor

from dlm.inverse_dynamics.data import QPSize, QPWeights
from dlm.inverse_dynamics.layer import InverseDynamics
from dlm.inverse_dynamics.parameters import FLAGS, ParameterBatch
from dlm.inverse_dynamics.problem import inverse_dynamics_problem
from expert.problems.contact import Cost
from tests.support.programs import LAYOUT


def test_4_ct6_is_a_disciplined_parametrised_program() -> None:
    weights = QPWeights.of(Cost(), dt=0.1, length=0.01, force=1.0, slack=1.0)
    problem, _, _ = inverse_dynamics_problem(QPSize(), weights)
    assert problem.is_dpp()


def test_the_solution_obeys_4_ct6(generic: Tensor) -> None:
    """The constraints stated a second time, in SI and with the flags' meaning at 0 and 1."""
    rows = LAYOUT.split(generic)
    P = LAYOUT.unflatten(
        torch.cat([(x.round() if n in FLAGS else x).flatten(2) for n, x in rows.items()], dim=-1)
    )
    with torch.no_grad():
        action = InverseDynamics(backend="batched")(P)
    p, lam = action.positions, action.forces
    start, edge = P.facets[..., 0, :], P.facets[..., 1, :] - P.facets[..., 0, :]
    rho = ((p - start) * edge).sum(-1) / edge.square().sum(-1)
    off = (p - start - rho[..., None] * edge).norm(dim=-1) * P.contact
    assert off.max() < 1e-7
    touching = P.contact == 1
    assert rho[touching].min() > -1e-6
    assert rho[touching].max() < 1 + 1e-6
    held = (P.stick[:, :-1] == 1) & touching[:, :-1] & touching[:, 1:]
    assert (rho[:, 1:] - rho[:, :-1])[held].abs().max() < 1e-6
    weights = torch.linalg.solve(P.cones.transpose(-1, -2), lam[..., None])[..., 0]
    assert weights.min() > -1e-6
    assert lam[P.stick == 0].abs().max() < 1e-8
    normal = weights.sum(-1)[P.stick == 1]
    assert (normal > P.force_limits[P.stick == 1][:, 0] - 1e-6).all()
    # Newton-Euler: what fingers and slack leave over is in the ground's cone, and nil without ground contact.
    couple = (P.reference_positions - P.poses[:, :, None, :2]), (p - P.reference_positions)
    torque = _cross(couple[0], lam) + _cross(couple[1], P.reference_forces)
    wrench = torch.cat([lam.sum(2), torque.sum(2)[..., None]], dim=-1)
    left = P.wrench - wrench - action.slack
    airborne = (P.external_contact == 0).all(-1)
    assert airborne.any()
    assert left[airborne].abs().max() < 1e-6


def _cross(u: Tensor, v: Tensor) -> Tensor:
    return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]


def test_flags_between_0_and_1_lead_from_free_to_held(truth: ParameterBatch) -> None:
    layer = InverseDynamics(backend="batched")
    shifted = replace(truth, facets=truth.facets + 0.01)  # the fingers would rather stay
    distance = []
    for share in (0.0, 0.5, 0.9, 0.99, 1.0):
        flagged = replace(shifted, contact=share * truth.contact)
        with torch.no_grad():
            p = layer(flagged).positions
        start, edge = shifted.facets[..., 0, :], shifted.facets[..., 1, :] - shifted.facets[..., 0, :]
        rho = ((p - start) * edge).sum(-1, keepdim=True) / edge.square().sum(-1, keepdim=True)
        distance.append(float(((p - start - rho.clamp(0, 1) * edge).norm(dim=-1) * truth.contact).mean()))
    assert distance == sorted(distance, reverse=True)
    assert distance[0] > 1e-3
    assert distance[-2] < 1e-4
    assert distance[-1] < 1e-8
