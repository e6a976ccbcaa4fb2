"""Pictures of a replay: the simulated object over its desired pose, fingers, contact forces."""

import os
from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes

from dlm.simulator.replay import Replay
from expert.drawing.canvas import (
    MOVING,
    Image8,
    new_figure,
    pixels,
    plain_axes,
    save_figure,
    save_frames,
    suffix,
)
from expert.drawing.marks import EDGE, FINGER, FINGER_FORCE, OBJECT, REACTION, draw_arrow, draw_half_plane
from expert.geometry.pose import Array, to_world
from expert.problems.contact import ContactTask

LONGEST_ARROW = 0.6
"""Length of the largest force over the object's size."""
FRAME_STRIDE, HOLD = 2, 12
"""Substeps per frame of an animation, and frames for which the last one stands still."""


def draw(task: ContactTask, replay: Replay, path: str | os.PathLike[str]) -> None:
    """Write a film strip of the knots (.png, .svg, .pdf) or an animation (.gif, .mp4); dashed: the desired pose."""
    if suffix(path) in MOVING:
        interval = task.trajectory.dt * (task.steps - 1) / (len(replay.substep_poses) - 1)
        # Four times slower than real: the motions of the data sets take 0.4 s.
        save_frames(_frames(task, replay), path, rate=max(5, round(0.25 / (interval * FRAME_STRIDE))))
        return
    figure = new_figure(2.6 * task.steps, 2.8)
    stride = (len(replay.substep_poses) - 1) // (task.steps - 1)
    for t, axes in enumerate(figure.subplots(1, task.steps)):
        _draw_moment(axes, task, replay, t * stride)
        axes.set_title(f"{t * task.trajectory.dt:.2f} s", fontsize=9)
    mm, deg = replay.final_error
    figure.suptitle(f"ends {mm:.2f} mm and {deg:.2f} deg from the goal", fontsize=9)
    save_figure(figure, path)


def _frames(task: ContactTask, replay: Replay) -> Iterator[Image8]:
    figure = new_figure(4.2, 4.2)
    axes = figure.add_subplot()
    image = None
    for i in range(0, len(replay.substep_poses), FRAME_STRIDE):
        axes.clear()
        _draw_moment(axes, task, replay, i)
        image = pixels(figure)
        yield image
    if image is not None:
        yield from [image] * HOLD


def _draw_moment(axes: Axes, task: ContactTask, replay: Replay, i: int) -> None:
    low, high = _view(task, replay)
    plain_axes(axes, low, high)
    for wall in task.environment.walls:
        draw_half_plane(axes, wall)
    axes.fill(*to_world(replay.substep_poses[i], task.body.vertices).T, color=OBJECT, ec=EDGE, lw=1, zorder=2)
    wanted = to_world(replay.desired[i], task.body.vertices)
    axes.plot(*np.concatenate([wanted, wanted[:1]]).T, "--", color=EDGE, lw=0.7, zorder=3)
    axes.plot(*replay.fingers[i].T, "o", color=FINGER, ms=5, zorder=5)
    largest = max(float(np.linalg.norm(replay.contacts.force, axis=1).max(initial=0)), 1e-12)
    scale = LONGEST_ARROW * task.body.size / largest
    now = replay.contacts.step == max(i - 1, 0)
    for point, force, finger in zip(
        replay.contacts.point[now], replay.contacts.force[now], replay.contacts.finger[now], strict=True
    ):
        colour = FINGER_FORCE if finger >= 0 else REACTION
        draw_arrow(axes, point - (scale * force if finger >= 0 else 0), scale * force, colour)


def _view(task: ContactTask, replay: Replay) -> tuple[Array, Array]:
    """Box around the object's motions and the fingers near it."""
    corners = to_world(np.concatenate([replay.substep_poses, replay.desired]), task.body.vertices).reshape(
        -1, 2
    )
    pad = 0.35 * task.body.size
    return corners.min(axis=0) - pad, corners.max(axis=0) + pad
