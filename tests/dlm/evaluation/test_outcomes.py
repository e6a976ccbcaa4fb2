import numpy as np
import pytest

from dlm.evaluation.animation import animate, input_film
from dlm.evaluation.curves import curves_figure
from dlm.evaluation.outcomes import Outcome, execute
from dlm.evaluation.picture import task_figure
from dlm.evaluation.report import png
from dlm.evaluation.table import Cell, Line, Table
from dlm.execution import expert_action, idle_action
from dlm.simulator import SimulatorSettings
from dlm.tasks import TaskBatch

RIGID = SimulatorSettings()


def outcome(tasks: TaskBatch, **shift: float) -> Outcome:
    """The expert's action with poses moved away from the desired ones at the last step."""
    poses = tasks.poses.numpy().copy()
    for name, value in shift.items():
        poses[:, -1, ["x", "y", "theta"].index(name)] += value
    return Outcome(
        action=expert_action(tasks),
        poses=poses,
        desired=tasks.poses.numpy(),
        labels=tasks.positions.numpy(),
    )


def test_the_expert_succeeds_and_idle_fingers_do_not(tasks: TaskBatch) -> None:
    expert, idle = (execute(f(tasks), tasks, RIGID) for f in (expert_action, idle_action))
    assert expert.success.all()
    assert not expert.dropped.any()
    assert not idle.success.any()
    first = idle.desired[:, :1].repeat(idle.desired.shape[1], axis=1)
    np.testing.assert_allclose(
        idle.poses, first, atol=1e-3
    )  # an object that nobody touches stays where it is


@pytest.mark.parametrize(
    ("shift", "success", "dropped"),
    [
        ({}, True, False),
        ({"x": 0.0019}, True, False),
        ({"x": 0.0021}, False, False),
        ({"theta": np.deg2rad(1.9)}, True, False),
        ({"theta": np.deg2rad(-2.1)}, False, False),
        ({"theta": 2 * np.pi}, True, False),
        ({"y": -0.0049}, False, False),
        ({"y": -0.0051}, False, True),
        ({"y": +0.0200}, False, False),
    ],
)
def test_success_and_drops_are_judged_at_the_end(
    tasks: TaskBatch, shift: dict[str, float], success: bool, dropped: bool
) -> None:
    moved = outcome(tasks, **shift)
    assert (moved.success == success).all()
    assert (moved.dropped == dropped).all()


def test_loss_and_rms_of_a_known_error(tasks: TaskBatch) -> None:
    moved = outcome(tasks, x=0.03)
    np.testing.assert_allclose(moved.object_loss, 3.0**2 / 15)
    rms_mm, rms_deg = moved.rms
    assert rms_mm == pytest.approx(30 / np.sqrt(5))
    assert rms_deg == pytest.approx(0, abs=1e-9)


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


def test_markdown_shows_every_number_with_its_spread(tasks: TaskBatch) -> None:
    idle = execute(idle_action(tasks), tasks, RIGID)
    cells = {"test": Cell.of([outcome(tasks, x=0.03), outcome(tasks, x=0.06)], idle)}
    table = Table(lines=[Line(model="DLM", cells=cells, forward=0.0123)], origin={"command": "x"})
    text = table.as_markdown()
    assert "| DLM | 1.500 ± 1.273 | 0.0123 | – |" in text
    assert "* command: x" in text
    assert table.as_csv().splitlines()[1].startswith("DLM,test,4,1.5")


def test_pictures_and_films_are_drawn(tasks: TaskBatch) -> None:
    expert = execute(expert_action(tasks), tasks, RIGID)
    figure = task_figure(tasks, 0, {"MDR": expert}, {"MDR": tasks.parameters})
    assert len(figure.axes) == 3 * 5  # input, derendered, simulated
    assert len(png(figure)) > 10_000
    film = animate(tasks, 0, expert.action, RIGID)
    assert film.count("<polygon") == 2
    assert film.count("<circle") == 2
    assert "nan" not in film
    assert input_film(tasks, 0).startswith("<img")


def test_curves_have_a_line_for_every_logged_loss() -> None:
    rows = [
        {
            f"{k}/{d}": 1.0 / (i + 1)
            for k in ("finger", "object")
            for d in ("train", "finetune", "test", "family")
        }
        | {"iteration": float(i)}
        for i in range(3)
    ]
    figure = curves_figure(
        {stage: [rows, rows] for stage in ("nn", "nnm", "mdr", "cvx", "dlm")}, {"test": 1.0}
    )
    assert [len(ax.get_lines()) for ax in figure.axes] == [9, 10, 7]
    assert [len(ax.collections) for ax in figure.axes] == [9, 9, 6]  # bands over the seeds
