"""Three ways to a plan for a perceived task: proposed classes, all classes, and the expert itself."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

from datasets.label import Label, Labelling, label
from dlm.structured.check import NODES, check
from dlm.structured.classes import Schedules
from expert.contact.model import model_of
from expert.types import ContactTask, IntArray, Plan


class Answer(NamedTuple):
    """plan: None where none was found, which proves nothing.  task: the one it solves.  checked: classes looked at."""

    plan: Plan | None
    task: ContactTask
    checked: int


class Planner(Protocol):
    """Answers a contact task."""

    def __call__(self, task: ContactTask) -> Answer: ...


Proposer = Callable[[ContactTask], list[IntArray]]
"""Batches of classes (k, 3) in the order in which they should be checked."""


@dataclass(frozen=True, kw_only=True)
class ClassPlanner:
    """Checks batches of proposed classes until one of them has a plan; the best of that batch is taken.

    propose: None for no learning, every class.  node_limit: see `check`.
    """

    schedules: Schedules = field(default_factory=Schedules)
    propose: Proposer | None = None
    node_limit: int = NODES

    def __call__(self, task: ContactTask) -> Answer:
        model, checked = model_of(task), 0
        propose = self.propose or self.every_class
        for classes in propose(task):
            checked += len(classes)
            found = check(task, self.schedules.modes(classes), node_limit=self.node_limit, model=model)
            if found.plan is not None:
                return Answer(found.plan, task, checked)
        return Answer(None, task, checked)

    def every_class(self, task: ContactTask) -> list[IntArray]:
        """No learning: all classes, in one batch."""
        return [self.schedules.classes(len(task.body.vertices))]


@dataclass(frozen=True, kw_only=True)
class ExpertPlanner:
    """The expert, over all contact sequences, with the checker's consent."""

    labelling: Labelling = field(default_factory=lambda: Labelling(node_limit=500))

    def __call__(self, task: ContactTask) -> Answer:
        answer = label(task, self.labelling)
        return Answer(answer.plan, answer.task, 0) if isinstance(answer, Label) else Answer(None, task, 0)
