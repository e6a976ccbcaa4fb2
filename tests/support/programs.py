"""What is differentiated in tests of the quadratic program."""

import cvxpy as cp
import torch
from cvxpylayers.interfaces.base import SolverInterface
from cvxpylayers.torch import CvxpyLayer
from torch import Tensor

from dlm.inverse_dynamics.layer import Action
from dlm.inverse_dynamics.parameters import Layout

LAYOUT = Layout()


BACKENDS = ("cvxpylayers", "batched")


def score(action: Action) -> Tensor:
    """A smooth number per task, (b,), to differentiate."""
    ramp = torch.linspace(-1, 1, action.positions[0].numel(), dtype=torch.float64).view(5, -1, 2)
    return (10 * ramp * action.positions + ramp.flip(0) * action.forces).sum((1, 2, 3))


def clipping(solver: SolverInterface) -> CvxpyLayer:
    """z* = max(a, b), by entries: the point nearest to a above b, through a solver of programs."""
    z, a, b = cp.Variable(3), cp.Parameter(3), cp.Parameter(3)
    problem = cp.Problem(cp.Minimize(cp.sum_squares(z - a)), [z >= b])
    return CvxpyLayer(problem, parameters=[a, b], variables=[z], solver=solver, canon_backend="SCIPY")


def assert_clips(solver: SolverInterface) -> None:
    """Solutions and gradients of a batch with one item that is no program."""
    a = torch.tensor([[1.0, 2.0, 3.0], [torch.nan, 0.0, 0.0], [-1.0, 5.0, 0.5]], dtype=torch.float64)
    b = torch.tensor([[2.0, 1.0, 3.5], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]], dtype=torch.float64)
    a.requires_grad_()
    b.requires_grad_()
    (z,) = clipping(solver)(a, b)
    good = [0, 2]
    torch.testing.assert_close(z[good], torch.maximum(a, b)[good], atol=1e-5, rtol=0)
    assert z[1].isnan().all()
    z[good].sum().backward()
    active = (b > a)[good].double()
    torch.testing.assert_close(a.grad[good], 1 - active, atol=1e-5, rtol=0)
    torch.testing.assert_close(b.grad[good], active, atol=1e-5, rtol=0)
