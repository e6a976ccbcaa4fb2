import numpy as np

from dlm.evaluation.outcomes import execute
from dlm.evaluation.qualitative import qualitative_figure
from dlm.execution import idle_action
from dlm.tasks import TaskBatch
from tests.support.outcomes import RIGID, outcome


def test_every_row_shows_the_demonstration_and_what_each_made_of_it(tasks: TaskBatch) -> None:
    rows = {"good": outcome(tasks), "idle": execute(idle_action(tasks), tasks, RIGID)}
    figure = qualitative_figure([("test", tasks, k, rows) for k in (0, 1)])
    titles = [ax.get_title() for ax in figure.axes]
    assert titles == ["demonstration", "good", "idle", "", "", ""]
    words = [ax.get_xlabel() for ax in figure.axes]
    assert ["✓" in text for text in words] == [False, True, False] * 2
    assert all(f"{rows['idle'].object_loss[k]:.2g} cm²" in words[3 * k + 2] for k in (0, 1))


def test_the_object_is_drawn_at_every_step(tasks: TaskBatch) -> None:
    figure = qualitative_figure([("test", tasks, 0, {"good": outcome(tasks)})])
    steps = tasks.poses.shape[1]
    demonstration, result = figure.axes
    assert len(demonstration.patches) == 1 + steps  # and the floor
    assert len(result.patches) == 1 + steps + 1  # and the goal
    drawn = demonstration.patches[-1].get_path().vertices[:-1]
    assert np.ptp(drawn, axis=0).max() > 0.02
