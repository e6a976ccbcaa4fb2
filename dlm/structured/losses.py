"""What the stages of `model: structured` learn by: classes (MDR), classes and what they cost (CVX), simulated motion (DLM)."""

from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import cross_entropy

from datasets.specification import Sample
from dlm.execution import idle_where_unsolved, simulate
from dlm.metrics import object_trajectory_loss
from dlm.policy import Policy
from dlm.simulator import SimulatorSettings
from dlm.structured.bias import Bias
from dlm.structured.calibration import Calibration
from dlm.structured.classes import Schedules
from dlm.structured.examples import Example
from dlm.structured.policies import ProposalPolicy
from dlm.structured.scorer import Ranker, stack
from dlm.tasks import TaskBatch
from expert.contact.fixed_modes import costs_at_modes
from expert.errors import InvalidProblem
from expert.geometry.pose import Array

MOST_REGRET = 10.0
"""Relative cost over the best class's at which regrets end; that of classes without any plan."""


def proposer(policy: Policy) -> ProposalPolicy:
    """The policy, if it has a scorer.  Raises InvalidProblem otherwise."""
    if not isinstance(policy, ProposalPolicy):
        raise InvalidProblem(
            "stage.loss", expected="a policy that proposes contact classes", got=type(policy).__name__
        )
    return policy


@dataclass(frozen=True, kw_only=True)
class ClassLoss:
    """Cross-entropy of the expert's class, the structured counterpart of 4-CT5; examples are varied anew each time."""

    splitting: bool = True
    mirroring: bool = True

    def __call__(self, policy: Policy, tasks: TaskBatch) -> Tensor:
        scorer = proposer(policy).scorer
        rng = np.random.default_rng(int(torch.randint(2**62, ())))
        examples = [
            Example.of(s).varied(rng, splitting=self.splitting, mirroring=self.mirroring)
            for s in tasks.samples
        ]
        return class_distance(scorer, examples)


def class_distance(scorer: Ranker, examples: list[Example]) -> Tensor:
    """Mean cross-entropy over the examples whose class the vocabulary has; 0 if there is none."""
    known = [(e, c) for e in examples if (c := e.contact_class(scorer.schedules)) is not None]
    if not known:
        return sum(p.sum() for p in scorer.parameters()) * torch.tensor(0.0)
    logits = scorer(stack([(e.vertices, e.poses) for e, _ in known]))
    s, a, b = torch.tensor([c for _, c in known]).T
    return cross_entropy(logits.flatten(1), (s * logits.shape[2] + a) * logits.shape[3] + b)


@dataclass(frozen=True, kw_only=True)
class CheckedClassLoss:
    """Cross-entropy, and the cost that the program finds for the classes, the structured counterpart of 4-CT7.

    The second part, times regret_weight, is the mean of log(1 + regret) under the scorer's probabilities; the regret of a
    class is its optimum over the best class's, less one.  Checking every class takes some 8 ms a task, once.
    """

    classes: ClassLoss = field(default_factory=ClassLoss)
    regret_weight: float = 1.0
    known: dict[int, Array] = field(default_factory=dict, repr=False, compare=False)

    def __call__(self, policy: Policy, tasks: TaskBatch) -> Tensor:
        scorer = proposer(policy).scorer
        logits = scorer(stack([(s.task.body.vertices, s.task.trajectory.poses) for s in tasks.samples]))
        regrets = [self._regret(scorer, s, logits[k], tasks.fingerprint) for k, s in enumerate(tasks.samples)]
        return self.classes(policy, tasks) + self.regret_weight * torch.stack(regrets).mean()

    def _regret(self, scorer: Ranker, sample: Sample, logits: Tensor, fingerprint: str) -> Tensor:
        key = hash((fingerprint, sample.index))
        if key not in self.known:
            self.known[key] = np.log1p(regrets(sample, scorer.schedules))
        classes = scorer.schedules.classes(len(sample.task.body.vertices))
        share = logits[tuple(torch.from_numpy(classes).T)].softmax(0)
        return share @ torch.from_numpy(self.known[key]).float()


def regrets(sample: Sample, schedules: Schedules) -> Array:
    """Relative cost of every class over the best one's, from 0 to MOST_REGRET, (k,)."""
    modes = schedules.modes(schedules.classes(len(sample.task.body.vertices)))
    bounds, costs = costs_at_modes(sample.task, modes, gap=1e-2)
    least = np.where(np.isfinite(costs), costs, np.maximum(bounds, 0.0))
    best = sample.plan.objective
    return np.clip(least / max(best, 1e-9 * sample.task.weight**2) - 1, 0.0, MOST_REGRET)


@dataclass(frozen=True, kw_only=True)
class CalibrationLoss:
    """4-CT10 as a function of the calibration, differentiated by central differences of `step` units through everything.

    A knob has a slope only where one of its sides is better by `worth` [cm^2]: L_sim is flat and steep in turns, and the
    mere middle of a flat stretch is no reason to leave a calibration.  prior: price of a knob's square.  bias: the videos are seen
    anew by such a camera.
    """

    simulator: SimulatorSettings
    step: float = 0.5
    worth: float = 1e-4
    prior: float = 1e-3
    bias: Bias | None = None

    def __call__(self, policy: Policy, tasks: TaskBatch) -> Tensor:
        proposing = proposer(policy)
        if self.bias is not None:
            tasks = self.bias.videos(tasks, proposing.base.camera)
        simulated = _Differences.apply(proposing.knobs, proposing, tasks, self)
        return simulated + self.prior * proposing.knobs.square().sum()

    def at(self, policy: ProposalPolicy, tasks: TaskBatch, knobs: Array) -> float:
        """Mean object-trajectory loss [cm^2]; tasks without a plan count as what idle fingers do."""
        model = policy.base.calibrated(Calibration.of(knobs))
        with torch.no_grad():
            action = idle_where_unsolved(policy.actions(tasks.video, model), tasks)
            return float(object_trajectory_loss(simulate(action, tasks, self.simulator), tasks.poses).mean())


class _Differences(torch.autograd.Function):
    """L_sim and its central differences."""

    @staticmethod
    def forward(
        ctx: Any, knobs: Tensor, policy: ProposalPolicy, tasks: TaskBatch, loss: CalibrationLoss
    ) -> Tensor:
        """The loss."""
        here = knobs.detach().numpy().copy()
        value = loss.at(policy, tasks, here)
        ctx.at, ctx.here, ctx.value, ctx.loss = partial(loss.at, policy, tasks), here, value, loss
        return torch.tensor(value, dtype=torch.float64)

    @staticmethod
    def backward(ctx: Any, *adjoints: Tensor) -> tuple[Tensor | None, ...]:
        """A knob has a slope only where a step along it lowers the loss by what is worth a move."""
        loss, slopes = ctx.loss, np.zeros(len(ctx.here))
        for k in range(len(slopes)):
            step = loss.step * np.eye(len(slopes))[k]
            ahead, behind = (ctx.at(ctx.here + sign * step) for sign in (1, -1))
            if min(ahead, behind) < ctx.value - loss.worth:
                slopes[k] = (ahead - behind) / (2 * loss.step)
        return adjoints[0] * torch.from_numpy(slopes), None, None, None
