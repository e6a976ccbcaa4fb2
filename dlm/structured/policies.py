"""The structured model as policies that `train.py` trains: a regressor (NN, NNM), the scorer's best guess (MDR), its proposals
checked (CVX, DLM)."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np
import torch
from torch import Tensor, nn

from datasets.limits import Number, check_numbers
from datasets.render import Camera, Frames
from dlm.inverse_dynamics.layer import Action, InverseDynamics
from dlm.perception import Perceived, PerceptionSettings, perceive
from dlm.policy import Policy, PolicyKind, seeded
from dlm.structured.calibration import NAMES, Calibration
from dlm.structured.classes import MEASURED, Schedules
from dlm.structured.model import Planned, StructuredModel
from dlm.structured.planners import ClassPlanner
from dlm.structured.planning import Planning
from dlm.structured.scorer import Encoder, Ranker, Scorer, stack
from expert.errors import InvalidProblem
from expert.problems.contact import ContactTask
from expert.world.values import IntArray, require

FORCE = 1.0
"""Unit of a regressor's forces [N]."""
REACH = 0.05
"""Unit of its positions [m]."""


class Perceiver:
    """Perception that remembers what it saw: training looks at the same videos again and again."""

    def __init__(self) -> None:
        self.seen: dict[tuple[bytes, Camera, PerceptionSettings], Perceived | InvalidProblem] = {}

    def __call__(self, video: Frames, camera: Camera, settings: PerceptionSettings) -> Perceived:
        key = hashlib.sha256(np.ascontiguousarray(video).tobytes()).digest(), camera, settings
        if key not in self.seen:
            try:
                self.seen[key] = perceive(video, camera, settings)
            except InvalidProblem as error:
                self.seen[key] = error
        answer = self.seen[key]
        if isinstance(answer, InvalidProblem):
            raise answer
        return answer


def unsolved(steps: int, fingers: int) -> Action:
    """No answer to one video."""
    nothing = torch.zeros(1, steps, fingers, 2, dtype=torch.float64)
    slack = torch.zeros(1, steps, 3, dtype=torch.float64)
    return Action(positions=nothing, forces=nothing, slack=slack, solved=torch.tensor([False]))


def joined(actions: list[Action]) -> Action:
    """One batch of several."""
    names = ("positions", "forces", "slack", "solved")
    return Action(**{name: torch.cat([getattr(a, name) for a in actions]) for name in names})


class ProposalPolicy(Policy):
    """The scorer ranks the contact classes, the check chooses among batches of them that end at the ranks `widths`.

    knobs: the calibration, in units of `calibration.UNITS`.
    """

    def __init__(self, scorer: Ranker, model: StructuredModel, widths: tuple[int, ...], widen: bool) -> None:
        super().__init__()
        self.scorer, self.widths, self.widen = scorer, widths, widen
        self.knobs = nn.Parameter(torch.zeros(len(NAMES), dtype=torch.float64))
        self.planner = ClassPlanner(schedules=scorer.schedules, propose=self.propose)
        self.base = replace(model, planner=self.planner)

    def propose(self, task: ContactTask) -> list[IntArray]:
        """Batches of classes, the likeliest first; without widening, only the first batch."""
        ranked = self.scorer.rank(task.body.vertices, task.trajectory.poses)
        batches = np.split(ranked, [w for w in self.widths if w < len(ranked)])
        return batches if self.widen else batches[:1]

    @property
    def model(self) -> StructuredModel:
        """As it is calibrated now."""
        return self.base.calibrated(Calibration.of(self.knobs.detach().numpy()))

    def forward(self, video: Tensor) -> Action:
        return self.actions(video, self.model)

    def actions(self, video: Tensor, model: StructuredModel) -> Action:
        """Of the given model on every video; unsolved where it finds no plan or no object."""
        return joined([self._action(frames, model) for frames in video.numpy()])

    def _action(self, frames: Frames, model: StructuredModel) -> Action:
        try:
            planned: Planned = model.act(frames)
        except InvalidProblem:
            return unsolved(len(frames), 2)
        return planned.action()


class RegressorPolicy(Policy):
    """The same tokens as the scorer's, but positions and forces are regressed: perception without structure."""

    def __init__(self, encoder: Encoder, model: StructuredModel, width: int) -> None:
        super().__init__()
        self.encoder, self.base = encoder, model
        self.head = nn.Sequential(nn.Linear(2 * width, width), nn.ReLU(), nn.Linear(width, 2 * 4))

    def forward(self, video: Tensor) -> Action:
        seen = [self._perceived(frames) for frames in video.numpy()]
        found = [p for p in seen if p is not None]
        if not found:
            return joined([unsolved(video.shape[1], 2)] * len(video))
        answers = iter(self._act(found))
        return joined([unsolved(video.shape[1], 2) if p is None else next(answers) for p in seen])

    def _perceived(self, frames: Frames) -> Perceived | None:
        try:
            return self.base.perceive(frames, self.base.camera, self.base.perception)
        except InvalidProblem:
            return None

    def _act(self, seen: list[Perceived]) -> list[Action]:
        geometry = stack([(p.vertices, p.poses) for p in seen])
        facets, steps = self.encoder(geometry, self.base.planning.tasks)
        weight = geometry.present[..., None].float()
        whole = (weight * facets).sum(1) / weight.sum(1)
        both = torch.cat([steps, whole[:, None].expand_as(steps)], -1)
        rows = self.head(both).double().unflatten(-1, (2, 4))
        positions = geometry.poses[:, :, None, :2] + REACH * rows[..., :2]
        slack = torch.zeros(1, rows.shape[1], 3, dtype=torch.float64)
        yes = torch.tensor([True])
        return [
            Action(positions=p[None], forces=f[None], slack=slack, solved=yes)
            for p, f in zip(positions, FORCE * rows[..., 2:], strict=True)
        ]


@dataclass(frozen=True, kw_only=True)
class StructuredArchitecture:
    """`model: structured`: how to build its policies.

    width, layers, heads: of the transformer.  widths: ranks at which batches of proposals end; the rest is one more batch.
    planning: margins and physical constants; schedules: the vocabulary of contact classes.
    """

    name: str = "structured"
    width: Annotated[int, Number(whole=True, least=1, most=10**4)] = 96
    layers: Annotated[int, Number(whole=True, least=1, most=100)] = 3
    heads: Annotated[int, Number(whole=True, least=1, most=1000)] = 4
    widths: tuple[int, ...] = (8, 64)
    schedules: tuple[str, ...] = MEASURED
    planning: Planning = field(default_factory=Planning)
    camera: Camera = field(default_factory=Camera)
    perception: PerceptionSettings = field(default_factory=PerceptionSettings)

    def __post_init__(self) -> None:
        check_numbers(self, "model.")
        require(
            self.width % self.heads == 0, "model.width", f"a multiple of heads = {self.heads}", self.width
        )
        ranks = self.widths if isinstance(self.widths, Sequence) else ()
        fits = all(Number(whole=True, least=1).holds(rank) for rank in ranks)
        widths = tuple(ranks) if fits else ()
        rising = all(a < b for a, b in zip((0, *widths), widths, strict=False))
        require(len(widths) > 0 and rising, "model.widths", "rising ranks of at least 1", self.widths)
        object.__setattr__(self, "widths", widths)

    def build(self, kind: PolicyKind, program: InverseDynamics | None = None, *, seed: int = 0) -> Policy:
        """regressor, best_guess or proposals, with fresh weights drawn from the seed.  The program is not needed."""
        kinds = ("regressor", "best_guess", "proposals")
        require(kind in kinds, "stage.policy", " or ".join(kinds) + " (model: structured)", kind)
        with seeded(seed):
            return self.regressor() if kind == "regressor" else self.proposer(kind)

    def model(self) -> StructuredModel:
        """Without learning."""
        return StructuredModel(
            camera=self.camera,
            perception=self.perception,
            planning=self.planning,
            planner=ClassPlanner(schedules=Schedules(tuple(self.schedules))),
            perceive=Perceiver(),
        )

    def regressor(self) -> RegressorPolicy:
        """NN, NNM."""
        steps = self.planning.tasks.steps
        encoder = Encoder(steps=steps, width=self.width, layers=self.layers, heads=self.heads)
        return RegressorPolicy(encoder, self.model(), self.width)

    def ranker(self, network: type[Ranker] = Scorer) -> Ranker:
        """The network that ranks contact classes."""
        return network(
            Schedules(tuple(self.schedules)),
            tasks=self.planning.tasks,
            steps=self.planning.tasks.steps,
            width=self.width,
            layers=self.layers,
            heads=self.heads,
        )

    def proposer(self, kind: PolicyKind = "proposals") -> ProposalPolicy:
        """MDR (best_guess: one class, no second chance), CVX and DLM (proposals)."""
        guess = kind == "best_guess"
        return ProposalPolicy(self.ranker(), self.model(), (1,) if guess else self.widths, widen=not guess)
