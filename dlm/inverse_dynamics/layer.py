"""Differentiable inverse dynamics (Thesis 4-CT6): mechanical parameters in, finger positions and forces out."""

from dataclasses import dataclass
from typing import Literal

import torch
from cvxpylayers.interfaces.base import SolverInterface
from cvxpylayers.torch import CvxpyLayer
from torch import Tensor, nn

from dlm.inverse_dynamics.data import QPData, QPSize, QPWeights, qp_data
from dlm.inverse_dynamics.diffcp import DiffcpClarabel
from dlm.inverse_dynamics.kkt import InteriorPointKKT
from dlm.inverse_dynamics.parameters import ParameterBatch
from dlm.inverse_dynamics.problem import inverse_dynamics_problem
from expert.problems.contact import Cost
from expert.world.values import require

Torque = Literal["first_order", "thesis"]
Backend = Literal["cvxpylayers", "batched"]


@dataclass(frozen=True, kw_only=True)
class Action:
    """What the fingers do, float64, SI: positions (b, t, c, 2) [m], forces (b, t, c, 2) [N, on the object], world frame.

    slack (b, t, 3): eps of 4-CT6 [N, N, N m].  solved (b,): whether the program was solved; the rows of an
    unsolved one are zeros and pass no gradient.
    """

    positions: Tensor
    forces: Tensor
    slack: Tensor
    solved: Tensor


class InverseDynamics(nn.Module):
    """The quadratic program 4-CT6 as a layer; docs/theory/inverse-dynamics.md derives it.

    size: numbers of steps, fingers, region rows and ground contacts.  dt [s] and cost: the expert's.
    torque: first_order, (p_ref - r) x lambda + (p - p_ref) x lambda_ref, or thesis, (p_ref - r) x lambda.
    backend: cvxpylayers (DIFFCP with Clarabel inside) or batched (PIQP and sparse KKT systems, some 20 times faster).
    slack: q, the price of |eps|_1 without dimensions; None: eps = 0, as the thesis has it after training.
    length [m], force [N]: units inside; with 0.01 m and 1 N both terms of the usual cost weigh alike.
    Raises InvalidProblem for options it does not know, and in use for parameters of another size.
    """

    def __init__(
        self,
        size: QPSize | None = None,
        *,
        dt: float = 0.1,
        cost: Cost | None = None,
        torque: Torque = "first_order",
        backend: Backend = "cvxpylayers",
        slack: float | None = 300.0,
        length: float = 0.01,
        force: float = 1.0,
    ) -> None:
        super().__init__()
        require(torque in ("first_order", "thesis"), "torque", "first_order or thesis", torque)
        require(backend in ("cvxpylayers", "batched"), "backend", "cvxpylayers or batched", backend)
        require(slack is None or slack > 0, "slack", "a positive number or None", slack)
        self.size, self.length, self.force, self.torque = size or QPSize(), length, force, torque
        weights = QPWeights.of(cost or Cost(), dt=dt, length=length, force=force, slack=slack)
        solver = DiffcpClarabel() if backend == "cvxpylayers" else InteriorPointKKT()
        self.program = Program(self.size, weights, solver)

    def forward(self, parameters: ParameterBatch) -> Action:
        """The optimal action of every task of the batch."""
        self._check(parameters)
        usable = finite_rows(parameters)
        safe = parameters.map(lambda x: torch.where(_like(usable, x), x, 0.0).double())
        data = qp_data(safe, length=self.length, force=self.force, couple=self.torque == "first_order")
        p, lam, eps = self.program(data)
        solved = usable & torch.stack([x.isfinite().flatten(1).all(1) for x in (p, lam, eps)]).all(0)
        p, lam, eps = (torch.where(_like(solved, x), x, 0.0) for x in (p, lam, eps))
        units = eps.new_tensor([self.force, self.force, self.force * self.length])
        return Action(positions=p * self.length, forces=lam * self.force, slack=eps * units, solved=solved)

    def _check(self, parameters: ParameterBatch) -> None:
        steps, fingers = parameters.contact.shape[1:]
        got = QPSize(
            steps=steps,
            fingers=fingers,
            rows=parameters.region_offsets.shape[-1],
            external=parameters.external_points.shape[-2],
        )
        require(got == self.size, "parameters", f"{self.size}", got)


class Program(nn.Module):
    """4-CT6 through cvxpylayers, solved and differentiated by `solver`."""

    def __init__(self, size: QPSize, weights: QPWeights, solver: SolverInterface) -> None:
        super().__init__()
        problem, parameters, x = inverse_dynamics_problem(size, weights)
        self.layer = CvxpyLayer(
            problem,
            parameters=list(parameters.values()),
            variables=[x.p, x.lam, x.eps],
            solver=solver,
            canon_backend="SCIPY",
        )

    def forward(self, data: QPData) -> tuple[Tensor, Tensor, Tensor]:
        """p, lambda and eps without dimensions; rows of nan where there is no solution."""
        return tuple(self.layer(*data.tensors().values()))


def finite_rows(parameters: ParameterBatch) -> Tensor:
    """Mask (b,) of the tasks whose parameters are all finite."""
    return torch.stack([x.isfinite().flatten(1).all(1) for x in parameters.named().values()]).all(0)


def _like(mask: Tensor, x: Tensor) -> Tensor:
    return mask.view(-1, *[1] * (x.dim() - 1))
