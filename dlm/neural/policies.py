"""The neural model as policies that `train.py` trains: one class through the program (MDR, CVX, DLM), or a regressor (NN, NNM)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import torch
from torch import Tensor

from datasets.limits import Number
from datasets.render import Frames
from dlm.inverse_dynamics.layer import Action, InverseDynamics
from dlm.inverse_dynamics.parameters import ParameterBatch
from dlm.neural.assembly import Margins, assemble, solve
from dlm.neural.pointer import Pointer
from dlm.policy import Policy, PolicyKind, seeded
from dlm.structured.calibration import NAMES, UNITS
from dlm.structured.features import Geometry
from dlm.structured.model import StructuredModel
from dlm.structured.policies import ProposalPolicy, StructuredArchitecture, joined, unsolved
from dlm.structured.scorer import Ranker, stack
from expert.errors import InvalidProblem
from expert.problems.contact import ContactTask
from expert.world.values import IntArray, require


class PointerPolicy(ProposalPolicy):
    """The likeliest class, made into mechanical parameters, through the program 4-CT6: differentiable from end to end.

    Its weights are those of a policy that has proposals checked (`NeuralArchitecture.proposer`), which needs no gradients.
    """

    def __init__(
        self, scorer: Ranker, model: StructuredModel, program: InverseDynamics, *, passes: int
    ) -> None:
        super().__init__(scorer, model, (1,), widen=False)
        self.program, self.passes = program, passes

    def forward(self, video: Tensor) -> Action:
        seen, rows = self.seen(video)
        if not seen:
            return joined([unsolved(video.shape[1], 2)] * len(video))
        geometry = geometry_of(seen)
        classes, _ = self.likeliest(geometry, 1)
        return scattered(self.act(geometry, classes[:, 0]), rows, len(video))

    def seen(self, video: Tensor) -> tuple[list[ContactTask], list[int]]:
        """What is to be done, as perceived, and in which of the videos (b, t, h, w, 3) an object is."""
        found = [(task, k) for k, v in enumerate(video.numpy()) if (task := self._perceived(v)) is not None]
        return [task for task, _ in found], [k for _, k in found]

    def likeliest(self, geometry: Geometry, count: int) -> tuple[IntArray, Tensor]:
        """The likeliest classes (b, k, 3) of each task, and the logarithms of their shares among these, (b, k)."""
        logits = self.scorer(geometry)
        best = logits.flatten(1).topk(count, dim=1)
        size = logits.shape[2]
        s, rest = best.indices // size**2, best.indices % size**2
        classes = torch.stack([s, rest // size, rest % size], -1)
        return classes.numpy(), best.values.log_softmax(1)

    def derender(self, video: Tensor) -> ParameterBatch | None:
        """P(t) with the likeliest classes; None where one of the videos shows no object."""
        seen, _ = self.seen(video)
        if len(seen) < len(video):
            return None
        geometry = geometry_of(seen)
        return self.assembled(geometry, self.likeliest(geometry, 1)[0][:, 0])

    def assembled(self, geometry: Geometry, classes: IntArray) -> ParameterBatch:
        """P(t) of tasks with their classes (b, 3), margins as they are calibrated."""
        return assemble(geometry, classes, self.scorer.schedules, self.scorer.tasks, self.margins())

    def act(self, geometry: Geometry, classes: IntArray) -> Action:
        """What the program makes of them; differentiable in the geometry and in the calibration."""
        return solve(self.program, self.assembled(geometry, classes), passes=self.passes)

    def margins(self) -> Margins:
        """What the calibration makes of the planner's margins."""
        given = Margins.of(self.scorer.tasks)
        more = dict(zip(NAMES, self.knobs * torch.from_numpy(UNITS), strict=True))
        return Margins(
            facet=(given.facet + more["margin"]).clamp(0.0, 0.45),
            cone=(given.cone + more["cone"]).clamp(0.2, 1.0),
            push=(given.push + more["push"]).clamp(0.0, 1.0),
        )

    def _perceived(self, frames: Frames) -> ContactTask | None:
        try:
            return self.base.planning.of(self.base.perceive(frames, self.base.camera, self.base.perception))
        except InvalidProblem:
            return None


def geometry_of(tasks: Sequence[ContactTask]) -> Geometry:
    """Polygons and poses of tasks, as the network sees them."""
    return stack([(task.body.vertices, task.trajectory.poses) for task in tasks])


def scattered(action: Action, rows: list[int], count: int) -> Action:
    """The action as some rows of a batch of so many; the others are unsolved."""
    index = torch.tensor(rows)

    def spread(x: Tensor) -> Tensor:
        return x.new_zeros(count, *x.shape[1:]).index_copy(0, index, x)

    return Action(
        positions=spread(action.positions),
        forces=spread(action.forces),
        slack=spread(action.slack),
        solved=spread(action.solved),
    )


@dataclass(frozen=True, kw_only=True)
class NeuralArchitecture(StructuredArchitecture):
    """`model: neural`.  passes: times that the program is solved, each linearised at the answer before; the rest as structured."""

    name: str = "neural"
    passes: Annotated[int, Number(whole=True, least=1, most=100)] = 5

    def build(self, kind: PolicyKind, program: InverseDynamics | None = None, *, seed: int = 0) -> Policy:
        """regressor or program, or proposals to be checked, with fresh weights drawn from the seed."""
        kinds = ("regressor", "program", "proposals")
        require(kind in kinds, "stage.policy", " or ".join(kinds) + " (model: neural)", kind)
        with seeded(seed):
            if kind == "program":
                program = program or InverseDynamics(backend="batched")
                return PointerPolicy(self.ranker(), self.model(), program, passes=self.passes)
            return self.regressor() if kind == "regressor" else self.proposer(kind)

    def ranker(self, network: type[Ranker] = Pointer) -> Ranker:
        """The pointer."""
        return super().ranker(network)
