"""Pictures of single tasks: input frames, derendered facets and contacts, fingers and forces, simulated motion (Fig. 4-7)."""

from collections.abc import Mapping

import matplotlib
import numpy as np
import torch
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dlm.evaluation.outcomes import Outcome
from dlm.inverse_dynamics.parameters import ParameterBatch
from dlm.policy import Policy
from dlm.tasks import TaskBatch
from expert.geometry.pose import Array, to_world

FINGER_COLOURS = ("tab:red", "tab:blue", "tab:purple", "tab:green")
DESIRED, SIMULATED, FLOOR = "0.55", "#f2c14e", "0.35"
REACH = 0.05
"""Width of the picture beyond the desired motion, on each side [m]."""
ARROW = 0.03
"""Length of an arrow that stands for a force m g [m]."""


def derendered(policy: Policy, tasks: TaskBatch) -> ParameterBatch | None:
    """P* of a policy that derenders."""
    policy.eval()
    with torch.no_grad():
        return policy.derender(tasks.video)


def task_figure(
    tasks: TaskBatch, k: int, outcomes: Mapping[str, Outcome], parameters: Mapping[str, ParameterBatch | None]
) -> Figure:
    """Task k: a row of input frames, then a row per architecture (first of its rows: what it derendered, if it does)."""
    rows = [
        row for name in outcomes for row in ([(name, True)] if parameters.get(name) else []) + [(name, False)]
    ]
    steps = tasks.video.shape[1]
    figure = Figure(figsize=(1.5 * steps, 1.25 * (len(rows) + 1)), layout="constrained")
    axes = figure.subplots(len(rows) + 1, steps, squeeze=False)
    view = window(tasks, k)
    for t in range(steps):
        axes[0, t].imshow(tasks.video[k, t].numpy(), interpolation="nearest")
        axes[0, t].set_title(f"{t * tasks.samples[k].task.trajectory.dt:.1f} s", fontsize=8)
    _label(axes[0, 0], "input")
    for (name, is_parameters), line in zip(rows, axes[1:], strict=True):
        _label(line[0], f"{name}\nderendered" if is_parameters else name)
        for t, ax in enumerate(line):
            if is_parameters:
                _draw_parameters(ax, tasks, k, t, parameters[name])
            else:
                _draw_outcome(ax, tasks, k, t, outcomes[name])
            ax.set(xlim=view[0], ylim=view[1], aspect="equal")
    for ax in axes.flat:
        ax.set(xticks=[], yticks=[])
    return figure


def window(tasks: TaskBatch, k: int) -> tuple[tuple[float, float], tuple[float, float]]:
    """What pictures of task k show: limits of x and y [m]."""
    sample = tasks.samples[k]
    corners = to_world(sample.task.trajectory.poses, sample.task.body.vertices).reshape(-1, 2)
    (left, _), (right, top) = corners.min(0) - REACH, corners.max(0) + REACH
    return (left, right), (-0.02, top)


def _label(ax: Axes, text: str) -> None:
    ax.set_ylabel(text, fontsize=8, rotation=0, ha="right", va="center")


def _polygon(ax: Axes, corners: Array, **style: object) -> None:
    ax.add_patch(matplotlib.patches.Polygon(corners, closed=True, **style))


def _draw_outcome(ax: Axes, tasks: TaskBatch, k: int, t: int, outcome: Outcome) -> None:
    """Desired outline, simulated object, fingers and their forces."""
    task = tasks.samples[k].task
    ax.axhspan(-1, 0, color=FLOOR, lw=0)
    _polygon(ax, to_world(outcome.poses[k, t], task.body.vertices), fc=SIMULATED, ec="k", lw=0.8)
    _polygon(ax, to_world(outcome.desired[k, t], task.body.vertices), fill=False, ec=DESIRED, lw=1, ls="--")
    for c, colour in zip(range(outcome.labels.shape[2]), FINGER_COLOURS, strict=False):
        place = outcome.action.positions[k, t, c].numpy()
        force = ARROW * outcome.action.forces[k, t, c].numpy() / task.weight
        if np.linalg.norm(force) > 1e-4:
            ax.plot(*np.stack([place, place - force]).T, color=colour, lw=1.2)
        ax.plot(*place, "o", color=colour, ms=3, clip_on=True)


def _draw_parameters(ax: Axes, tasks: TaskBatch, k: int, t: int, parameters: ParameterBatch | None) -> None:
    """Derendered object position, facets (strong where in contact) and ground contacts over the true outline."""
    if parameters is None:
        return
    task, P = tasks.samples[k].task, parameters
    ax.axhspan(-1, 0, color=FLOOR, lw=0)
    _polygon(
        ax, to_world(task.trajectory.poses[t], task.body.vertices), fill=False, ec=DESIRED, lw=1, ls="--"
    )
    ax.plot(*P.poses[k, t, :2].numpy(), "+", color="k", ms=5)
    for c, colour in zip(range(P.contact.shape[2]), FINGER_COLOURS, strict=False):
        touching = float(P.contact[k, t, c].clamp(0.15, 1))
        ax.plot(*P.facets[k, t, c].numpy().T, color=colour, lw=2.5, alpha=touching, solid_capstyle="round")
    for point, present in zip(P.external_points[k, t].numpy(), P.external_contact[k, t], strict=True):
        if present > 0.5:
            ax.plot(*point, "^", color="tab:green", ms=4)
