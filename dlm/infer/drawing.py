"""The answer over its video, beside what comes of it in simulation, as an animation."""

import os
from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes

from dlm.infer.inference import Inference
from dlm.simulator.replay import Replay
from expert.drawing.canvas import Image8, new_figure, pixels, plain_axes, save_frames
from expert.drawing.marks import EDGE, FINGER, FINGER_FORCE, OBJECT, draw_arrow, draw_half_plane
from expert.geometry.pose import Array, to_world
from expert.problems.contact import ContactTask, Plan

FRAME_STRIDE, HOLD, RATE = 2, 10, 10.0
"""Substeps per frame of the animation, frames for which the last one stands still, frames per second."""
LONGEST_ARROW = 0.5
"""Length of the largest force over the object's size."""


def draw_inference(answer: Inference, path: str | os.PathLike[str]) -> None:
    """Write an animation (.gif, .mp4).  Left: the video, with perceived outline, planned fingers and forces; right: the
    simulated motion, dashed: the perceived one.  Without a plan: the video with what was perceived.
    """
    save_frames(list(_frames(answer)), path, rate=RATE)


def _frames(answer: Inference) -> Iterator[Image8]:
    figure = new_figure(8.4, 4.2)
    left, right = figure.subplots(1, 2)
    substeps = 1 if answer.result is None else (len(answer.result.substep_poses) - 1) // (_steps(answer) - 1)
    moments = range(0, substeps * (_steps(answer) - 1) + 1, FRAME_STRIDE if answer.result else 1)
    image = None
    for i in moments:
        for axes in (left, right):
            axes.clear()
            plain_axes(axes, *_box(answer))
        _draw_video(left, answer, round(i / substeps))
        _draw_simulation(right, answer, i)
        image = pixels(figure)
        yield image
    yield from [image] * HOLD if image is not None else []


def _steps(answer: Inference) -> int:
    return len(answer.planned.perceived.poses)


def _draw_video(axes: Axes, answer: Inference, t: int) -> None:
    """Frame nearest to step t; a picture row is y in the world."""
    view, seen = answer.view, answer.planned.perceived
    time = t * answer.clip.duration / (_steps(answer) - 1)
    frame = answer.clip.frames[int(np.abs(answer.clip.times - time).argmin())]
    height, width = frame.shape[:2]
    half, below = view.scale * width / 2, view.scale * (height - view.floor)
    axes.imshow(
        frame, extent=(-half, half, -below, view.scale * view.floor), interpolation="nearest", zorder=0
    )
    _outline(axes, to_world(seen.poses[t], seen.vertices), "-", "white")
    axes.set_title(f"video {time:.2f} s, perceived outline, plan", fontsize=9)
    if answer.plan is not None and answer.task is not None:
        _draw_fingers(axes, answer.task, answer.plan, t)
    plain_axes(axes, *_box(answer))


def _draw_simulation(axes: Axes, answer: Inference, i: int) -> None:
    if answer.task is None or answer.result is None:
        axes.set_title(f"no plan: {answer.reason}"[:60], fontsize=9)
        return
    task, result = answer.task, answer.result
    for wall in task.environment.walls:
        draw_half_plane(axes, wall)
    axes.fill(*to_world(result.substep_poses[i], task.body.vertices).T, color=OBJECT, ec=EDGE, lw=1, zorder=2)
    _outline(axes, to_world(result.desired[i], task.body.vertices), "--", EDGE)
    axes.plot(*result.fingers[i].T, "o", color=FINGER, ms=5, zorder=5)
    axes.set_title(f"simulated: {_end(result)}", fontsize=9)


def _end(result: Replay) -> str:
    mm, deg = result.final_error
    return f"ends {mm:.2f} mm, {deg:.2f}° from the video's goal"


def _draw_fingers(axes: Axes, task: ContactTask, plan: Plan, t: int) -> None:
    scale = LONGEST_ARROW * task.body.size / max(float(np.linalg.norm(plan.forces, axis=-1).max()), 1e-9)
    for place, force in zip(plan.positions[t], plan.forces[t], strict=True):
        draw_arrow(axes, place - scale * force, scale * force, FINGER_FORCE)
    axes.plot(*plan.positions[t].T, "o", color=FINGER, mec="white", ms=6, zorder=6)


def _outline(axes: Axes, corners: Array, style: str, colour: str) -> None:
    axes.plot(*np.concatenate([corners, corners[:1]]).T, style, color=colour, lw=1, zorder=3)


def _box(answer: Inference) -> tuple[Array, Array]:
    """Around the object's motion and the fingers near it."""
    seen = answer.planned.perceived
    corners = to_world(seen.poses, seen.vertices).reshape(-1, 2)
    pad = 0.4 * float(np.ptp(seen.vertices, axis=0).max())
    return corners.min(axis=0) - pad, corners.max(axis=0) + pad
