import numpy as np
import pytest

from dlm.evaluation.outcomes import execute
from dlm.evaluation.table import CLIP, Cell, Line, Table
from dlm.execution import idle_action
from dlm.tasks import TaskBatch
from tests.support.outcomes import RIGID, outcome


def test_cells_average_over_tasks_and_seeds(tasks: TaskBatch) -> None:
    idle = execute(idle_action(tasks), tasks, RIGID)
    near, far = outcome(tasks, x=0.03), outcome(tasks, x=0.06, y=-0.006)
    cell = Cell.of([near, far], idle)
    losses = [9 / 15, (36 + 0.36) / 15]
    assert cell.loss == pytest.approx(np.mean(losses))
    assert cell.spread == pytest.approx(np.std(losses, ddof=1))
    assert cell.ratio == pytest.approx(np.mean(losses) / idle.object_loss.mean())
    assert cell.dropped == [[], [0, 1, 2, 3]]
    assert cell.finger_loss == 0
    assert Cell.of([idle], idle).finger_loss is None


def test_one_object_that_is_flung_away_counts_no_more_than_the_clip(tasks: TaskBatch) -> None:
    idle = execute(idle_action(tasks), tasks, RIGID)
    flung = outcome(tasks, x=1.0)
    assert flung.object_loss.min() > 100
    assert Cell.of([flung], idle).clipped == pytest.approx(CLIP / idle.object_loss.mean())
    near = outcome(tasks, x=0.03)
    assert Cell.of([near], idle).clipped == pytest.approx(Cell.of([near], idle).ratio)


def test_markdown_shows_every_number_with_its_spread(tasks: TaskBatch) -> None:
    idle = execute(idle_action(tasks), tasks, RIGID)
    cells = {"test": Cell.of([outcome(tasks, x=0.03), outcome(tasks, x=0.06)], idle)}
    table = Table(lines=[Line(model="DLM", cells=cells, forward=0.0123)], origin={"command": "x"})
    text = table.as_markdown()
    assert "| DLM | 1.500 ± 1.273 | 0.0123 | – |" in text
    assert "* command: x" in text
    assert table.as_csv().splitlines()[1].startswith("DLM,test,4,1.5")
