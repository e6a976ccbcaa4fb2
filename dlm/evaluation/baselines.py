"""Rows that nobody trained: perceived geometry, planned for by checking every contact class, or by the expert."""

from collections.abc import Callable

from datasets.render import Frames
from dlm.execution import idle_where_unsolved
from dlm.inverse_dynamics.layer import Action
from dlm.structured import ExpertPlanner, StructuredModel
from dlm.structured.policies import joined, unsolved
from dlm.tasks import TaskBatch
from expert.errors import InvalidProblem


def unlearned() -> dict[str, Callable[[TaskBatch], Action]]:
    """By title in the table; idle fingers where nothing is perceived or planned."""
    models = {
        "no learning": StructuredModel(),
        "expert, perceived": StructuredModel(planner=ExpertPlanner()),
    }
    return {title: _row(model) for title, model in models.items()}


def _row(model: StructuredModel) -> Callable[[TaskBatch], Action]:
    return lambda tasks: idle_where_unsolved(joined([_action(model, s.video) for s in tasks.samples]), tasks)


def _action(model: StructuredModel, video: Frames) -> Action:
    try:
        return model.act(video).action()
    except InvalidProblem:
        return unsolved(len(video), 2)
