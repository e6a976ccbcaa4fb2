"""Three ways to a plan for a perceived task: proposed classes, all classes, and the expert itself."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

import numpy as np

from datasets.label import Label, Labelling, label
from dlm.structured.check import NODES, check
from dlm.structured.classes import Schedules
from dlm.structured.trial import Trial
from expert.problems.contact import ContactTask, Plan
from expert.world.values import IntArray


class Answer(NamedTuple):
    """plan: None where none was found, which proves nothing.  task: the one it solves.  checked: classes looked at.

    risk: of `Trial.risk` [cm^2]; 0 without trials.
    """

    plan: Plan | None
    task: ContactTask
    checked: int
    risk: float = 0.0


class Planner(Protocol):
    """Answers a contact task; answers of a risk up to `acceptable` need no alternative."""

    @property
    def acceptable(self) -> float: ...

    def __call__(self, task: ContactTask) -> Answer: ...


Proposer = Callable[[ContactTask], list[IntArray]]
"""Batches of classes (k, 3) in the order in which they should be checked."""


@dataclass(frozen=True, kw_only=True)
class ClassPlanner:
    """Checks batches of proposed classes until one of them has a plan; the best of that batch is taken.

    propose: None for no learning, every class.  trial: None takes the cheapest plan as it is; otherwise the cheapest that
    survives its trial, or the one of least risk among a few.  node_limit: see `check`.
    """

    schedules: Schedules = field(default_factory=Schedules)
    propose: Proposer | None = None
    trial: Trial | None = None
    node_limit: int = NODES

    def __call__(self, task: ContactTask) -> Answer:
        checked = 0
        tries = 1 if self.trial is None else self.trial.candidates
        safest = Answer(None, task, 0, np.inf)
        for classes in (self.propose or self.every_class)(task):
            checked += len(classes)
            modes = self.schedules.modes(classes)
            while tries > 0 and len(modes):
                plan = check(task, modes, node_limit=self.node_limit).plan
                if plan is None:
                    break
                risk = 0.0 if self.trial is None else self.trial.risk(task, plan)
                if safest.plan is None or risk < safest.risk:
                    safest = Answer(plan, task, checked, risk)
                if self.trial is None or risk <= self.trial.good:
                    return safest
                modes, tries = modes[(modes != plan.modes).any(axis=(1, 2))], tries - 1
        return safest._replace(checked=checked)

    @property
    def acceptable(self) -> float:
        """What trials call good; without trials, every plan is."""
        return np.inf if self.trial is None else self.trial.good

    def every_class(self, task: ContactTask) -> list[IntArray]:
        """No learning: all classes, in one batch."""
        return [self.schedules.classes(len(task.body.vertices))]


@dataclass(frozen=True, kw_only=True)
class ExpertPlanner:
    """The expert, over all contact sequences, with the checker's consent."""

    labelling: Labelling = field(default_factory=lambda: Labelling(node_limit=500))
    acceptable: float = np.inf

    def __call__(self, task: ContactTask) -> Answer:
        answer = label(task, self.labelling)
        return Answer(answer.plan, answer.task, 0) if isinstance(answer, Label) else Answer(None, task, 0)
