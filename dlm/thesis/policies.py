"""The architectures of Table 4.1: from video to the fingers' action (Thesis Ch. 4.3).

NN and NNM are the perceptron policy, MDR, CVX and DLM the program policy; what tells the five apart is what they learn
from (losses.py, configs/stage).  Every policy gives the same action, finger positions and forces at the knots.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from dlm.inverse_dynamics.layer import Action, InverseDynamics
from dlm.inverse_dynamics.parameters import Layout, ParameterBatch
from dlm.policy import Policy, PolicyKind, seeded
from dlm.tasks import TaskBatch
from dlm.thesis.derender import Derenderer, NetworkSizes, perceptron
from expert.world.values import require


class DerenderingPolicy(Policy):
    """A policy that begins with a derenderer."""

    derenderer: Derenderer

    def fit_centre(self, tasks: TaskBatch) -> None:
        self.derenderer.fit_centre(tasks.parameters)


class PerceptronPolicy(DerenderingPolicy):
    """NN, NNM: a perceptron takes the place of the program.  Its input has the form of P*, but no label gives it a meaning."""

    centre: Tensor
    scale: Tensor

    def __init__(self, layout: Layout, sizes: NetworkSizes) -> None:
        super().__init__()
        self.derenderer = Derenderer(layout, sizes)
        knots = torch.zeros(sizes.steps, layout.fingers, 4, dtype=torch.float64)
        self.actor = perceptron(sizes.steps * layout.width, knots.numel(), sizes)
        self.register_buffer("centre", knots)
        scale = [layout.length, layout.length, layout.force, layout.force]
        self.register_buffer("scale", torch.tensor(scale, dtype=torch.float64), persistent=False)

    def fit_centre(self, tasks: TaskBatch) -> None:
        super().fit_centre(tasks)
        self.centre.copy_(torch.cat([tasks.positions, tasks.forces], dim=-1).mean(0))

    def forward(self, video: Tensor) -> Action:
        rows = self.actor(self.derenderer(video).flatten(1))
        knots = self.centre + self.scale * rows.double().unflatten(1, self.centre.shape)
        return Action(
            positions=knots[..., :2],
            forces=knots[..., 2:],
            slack=torch.zeros(*video.shape[:2], 3, dtype=torch.float64),
            solved=torch.ones(len(video), dtype=torch.bool),
        )


class ProgramPolicy(DerenderingPolicy):
    """MDR, CVX, DLM: the quadratic program 4-CT6 turns derendered parameters into an action."""

    def __init__(self, layout: Layout, sizes: NetworkSizes, program: InverseDynamics) -> None:
        super().__init__()
        self.derenderer = Derenderer(layout, sizes)
        self.program = program

    def derender(self, video: Tensor) -> ParameterBatch:
        return self.derenderer.parameters_of(video)

    def forward(self, video: Tensor) -> Action:
        return self.program(self.derender(video))


@dataclass(frozen=True, kw_only=True)
class ThesisArchitecture:
    """`model: thesis`: how to build the policies of the thesis."""

    name: str = "thesis"
    sizes: NetworkSizes
    layout: Layout

    def build(self, kind: PolicyKind, program: InverseDynamics, *, seed: int) -> Policy:
        """A policy with fresh weights drawn from the seed."""
        require(kind in ("perceptron", "program"), "stage.policy", "perceptron or program", kind)
        with seeded(seed):
            if kind == "perceptron":
                return PerceptronPolicy(self.layout, self.sizes)
            return ProgramPolicy(self.layout, self.sizes, program)
