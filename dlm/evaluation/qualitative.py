"""Whole motions in one picture each: rows of tasks, columns of architectures (Fig. 4-7)."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from dlm.evaluation.outcomes import Outcome
from dlm.evaluation.picture import DESIRED, FINGER_COLOURS, FLOOR, SIMULATED, window
from dlm.tasks import TaskBatch
from expert.geometry.pose import to_world

Row = tuple[str, TaskBatch, int, Mapping[str, Outcome]]
"""Name of a data set, its tasks, the number of one of them, and what every architecture made of it."""


def qualitative_figure(rows: Sequence[Row]) -> Figure:
    """First column: the demonstrated motion; then what became of it."""
    titles = list(rows[0][3])
    figure = Figure(figsize=(1.75 * (len(titles) + 1), 1.75 * len(rows)), layout="constrained")
    axes = figure.subplots(len(rows), len(titles) + 1, squeeze=False)
    for line, (dataset, tasks, k, outcomes) in zip(axes, rows, strict=True):
        poses = tasks.poses[k].numpy()
        _motion(line[0], tasks, k, poses)
        line[0].set_ylabel(f"{dataset} {k}\n{tasks.samples[k].family.replace('_', ' ')}", fontsize=8)
        for ax, outcome in zip(line[1:], outcomes.values(), strict=True):
            _motion(ax, tasks, k, outcome.poses[k])
            _goal(ax, tasks, k)
            _fingers(ax, tasks, k, outcome)
            mark = "✓" if outcome.success[k] else ""
            ax.set_xlabel(f"{outcome.object_loss[k]:.2g} cm² {mark}", fontsize=7, labelpad=2)
    for ax, title in zip(axes[0], ["demonstration", *titles], strict=True):
        ax.set_title(title, fontsize=9)
    return figure


def _motion(ax: Axes, tasks: TaskBatch, k: int, poses: np.ndarray) -> None:
    """The object at every step, from faint to strong."""
    x, y = window(tasks, k)
    ax.axhspan(-1, 0, color=FLOOR, lw=0)
    for strength, corners in zip(
        np.linspace(0.15, 0.9, len(poses)),
        to_world(poses, tasks.samples[k].task.body.vertices),
        strict=True,
    ):
        ax.add_patch(Polygon(corners, closed=True, fc=SIMULATED, ec="k", lw=0.7, alpha=strength))
    ax.set(xlim=x, ylim=y, aspect="equal", xticks=[], yticks=[])


def _goal(ax: Axes, tasks: TaskBatch, k: int) -> None:
    """Where the object was to end."""
    corners = to_world(tasks.poses[k, -1].numpy(), tasks.samples[k].task.body.vertices)
    ax.add_patch(Polygon(corners, closed=True, fill=False, ec=DESIRED, lw=1.2, ls="--"))


def _fingers(ax: Axes, tasks: TaskBatch, k: int, outcome: Outcome) -> None:
    """Finger positions at the knots, as the architecture gave them; filled where it wants to push."""
    forces = outcome.action.forces[k].norm(dim=-1).numpy()
    for c, colour in zip(range(outcome.labels.shape[2]), FINGER_COLOURS, strict=False):
        path = outcome.action.positions[k, :, c].numpy()
        pushing = forces[:, c] > 0.02 * tasks.samples[k].task.weight
        ax.plot(*path.T, color=colour, lw=0.8, clip_on=True)
        ax.scatter(
            path[:, 0],
            path[:, 1],
            s=9,
            linewidths=0.7,
            ec=colour,
            fc=np.where(pushing, colour, "white"),
            zorder=3,
        )
