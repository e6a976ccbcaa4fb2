"""Pictures of certified grasps: starts, finger paths, nested cages, and executions that all end alike (Fig. 5-28, 5-29)."""

import os
from collections.abc import Iterator

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from expert.drawing.canvas import (
    EDGE,
    FINGER,
    MOVING,
    OBJECT,
    Image8,
    new_figure,
    pixels,
    plain_axes,
    save_figure,
    save_frames,
    suffix,
)
from expert.errors import InvalidProblem
from expert.geometry.pose import Array, to_world
from expert.grasping.executions import executions
from expert.grasping.sweeping import Sweep
from expert.problems.grasp import GraspProblem, GraspSolution, arrangement_at
from expert.world.slices import free_components, obstacles_at

START, GOAL, PATH = "#8d8678", "#7a3db8", "#1f5fbf"
"""Grey starts, purple goal, blue finger paths, as in the thesis's Fig. 5-28."""
RUNS, SHOWN = 60, 12
RATE, FRAMES, HOLD = 12.0, 32, 10
"""Of an animation: frames per second, and how many move and then stand."""


def draw(task: GraspProblem, answer: GraspSolution | None, path: str | os.PathLike[str]) -> None:
    """Write a picture (.png, .svg, .pdf) or an animation of executions from random starts in Q0.

    Raises InvalidProblem where there are no finger paths, or no set of starts.
    """
    if answer is None or len(answer.path) == 0:
        raise InvalidProblem("path", expected="finger paths to draw", got="none", remedy="solve it first")
    runs = executions(task, answer, RUNS)
    if suffix(path) in MOVING:
        save_frames(_frames(task, answer, runs), path, rate=RATE)
    else:
        save_figure(grasp_figure(task, answer, runs), path)


def grasp_figure(task: GraspProblem, answer: GraspSolution, runs: Sweep) -> Figure:
    """Above: workspace, nested slices of the goal's cage, orientations over the path.  Below: all runs at each knot."""
    knots = len(answer.path)
    figure = new_figure(max(9.0, 2.1 * knots), 6.2)
    above, below = figure.subfigures(2, 1, squeeze=False, height_ratios=(1.35, 1))[:, 0]
    workspace, slices, turning = above.subplots(1, 3)
    draw_starts(workspace, task, answer, runs)
    _draw_slices(slices, task, answer)
    _draw_turning(turning, task, runs)
    for k, axes in enumerate(below.subplots(1, knots)):
        draw_moment(axes, task, answer, runs, float(k))
        axes.set_title(f"knot {k}", fontsize=8)
    figure.suptitle(_summary(task, runs), fontsize=9)
    return figure


def _summary(task: GraspProblem, runs: Sweep) -> str:
    off, turned = runs.misses(task.pose)
    jammed = int(np.isfinite(runs.stalled).sum())
    jams = f", {jammed} jam on the way" if jammed else ""
    size, angle = off.max() / task.shape.size, np.degrees(turned.max())
    return f"{len(off)} random starts end within {size:.1e} of the size and {angle:.1e} deg of the goal{jams}"


def draw_starts(axes: Axes, task: GraspProblem, answer: GraspSolution, runs: Sweep) -> None:
    """Start poses in grey, the goal in purple, finger paths in blue."""
    for pose in runs.poses[:SHOWN, 0]:
        axes.plot(*_outline(task, pose).T, color=START, lw=0.5, alpha=0.7, zorder=1)
    axes.fill(*_outline(task, task.pose).T, color=(*to_rgb(GOAL), 0.15), ec=GOAL, lw=1.3, zorder=2)
    for finger in np.swapaxes(answer.path, 0, 1):
        axes.plot(*finger.T, "-", color=PATH, lw=1, zorder=3)
        axes.plot(*finger[0], "o", mfc="white", mec=FINGER, ms=5, zorder=4)
        axes.plot(*finger[-1], "o", color=FINGER, ms=4, zorder=4)
    plain_axes(axes, *_view(task, answer, runs))
    axes.set_title("starts, goal and finger paths", fontsize=8)


def _draw_slices(axes: Axes, task: GraspProblem, answer: GraspSolution) -> None:
    """Free positions around the goal at its orientation, knot by knot, among the obstacles of the first."""
    angle, here = float(task.pose[2]), shapely.Point(task.pose[:2])
    first = arrangement_at(task, answer, 0.0)
    for obstacle in obstacles_at(first.shape, first.fingers, first.wall_ends, angle):
        axes.fill(*np.array(obstacle.exterior.coords).T, color="#cfc9bd", ec=EDGE, lw=0.5, alpha=0.6)
    reach = 0.0
    for k in range(len(answer.path)):
        for part in free_components(task.shape, answer.fingers(float(k)), first.wall_ends, angle):
            if part.distance(here) < 1e-6 * task.shape.size:
                outline = np.array(part.exterior.coords)
                reach = max(reach, float(np.abs(outline - task.pose[:2]).max()))
                axes.fill(*outline.T, color=(*to_rgb(PATH), 0.25), ec=PATH, lw=0.7)
    axes.plot(*task.pose[:2], "+", color=GOAL, ms=7)
    pad = max(1.4 * reach, 0.02 * task.shape.size)
    plain_axes(axes, task.pose[:2] - pad, task.pose[:2] + pad)
    axes.set_title(f"free positions at the goal's orientation\n({2e3 * pad:.0f} mm wide)", fontsize=8)


def _draw_turning(axes: Axes, task: GraspProblem, runs: Sweep) -> None:
    """Orientations of all runs over the path, within the half-ranges that the cages keep."""
    turned = np.degrees(runs.poses[..., 2] - task.pose[2])
    knots, limits = np.arange(len(task.half_ranges)), np.degrees(task.half_ranges)
    axes.fill_between(knots, -limits, limits, color=(*to_rgb(PATH), 0.15), lw=0)
    axes.plot(runs.s, turned.T, color=START, lw=0.5, alpha=0.7)
    axes.set_xticks(knots)
    axes.set_xlabel("knot", fontsize=8)
    axes.set_ylabel("orientation [deg]", fontsize=8)
    axes.tick_params(labelsize=7)
    axes.set_title("orientations and the cages' limits", fontsize=8)


def draw_moment(axes: Axes, task: GraspProblem, answer: GraspSolution, runs: Sweep, s: float) -> None:
    """Some of the runs on top of each other, and the fingers, at path parameter s."""
    sample = int(np.abs(runs.s - s).argmin())
    for pose in runs.poses[:SHOWN, sample]:
        axes.fill(*_outline(task, pose).T, color=(*to_rgb(OBJECT), 0.25), lw=0)
        axes.plot(*_outline(task, pose).T, color=EDGE, lw=0.6, alpha=0.7)
    axes.plot(*_outline(task, task.pose).T, "--", color=GOAL, lw=0.8)
    axes.plot(*answer.fingers(s).T, "o", color=FINGER, ms=4, zorder=4)
    plain_axes(axes, *_view(task, answer, runs))


def _frames(task: GraspProblem, answer: GraspSolution, runs: Sweep) -> Iterator[Image8]:
    figure = new_figure(2.8, 2.8)
    axes = figure.add_subplot()
    image = None
    for s in runs.s[:: max(1, len(runs.s) // FRAMES)]:
        axes.clear()
        draw_moment(axes, task, answer, runs, float(s))
        image = pixels(figure)
        yield image
    if image is not None:
        yield from [image] * HOLD


def _outline(task: GraspProblem, pose: Array) -> Array:
    corners = to_world(pose, task.shape.vertices)
    return np.concatenate([corners, corners[:1]])


def _view(task: GraspProblem, answer: GraspSolution, runs: Sweep) -> tuple[Array, Array]:
    """Box around everything that the picture of the starts shows."""
    corners = to_world(runs.poses[:SHOWN, 0], task.shape.vertices).reshape(-1, 2)
    points = np.concatenate([corners, answer.path.reshape(-1, 2), _outline(task, task.pose)])
    pad = 0.05 * task.shape.size
    return points.min(axis=0) - pad, points.max(axis=0) + pad
