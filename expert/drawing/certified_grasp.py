"""Pictures of certified grasps: starts, finger paths, nested cages, and executions that all end alike (Fig. 5-28, 5-29)."""

import os
from collections.abc import Iterator

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from expert.drawing.canvas import (
    MOVING,
    Image8,
    new_figure,
    pixels,
    plain_axes,
    room_below,
    save_figure,
    save_frames,
    suffix,
)
from expert.drawing.marks import (
    CAPTION,
    EDGE,
    FINGER,
    GOAL,
    LABEL,
    NUMBER,
    OBJECT,
    PATH,
    START,
    closed,
    draw_fingers,
    legend,
    scale_bar,
)
from expert.errors import InvalidProblem
from expert.geometry.pose import Array, to_world
from expert.grasping.executions import executions
from expert.grasping.sweeping import NEAR, TURNED, Sweep
from expert.problems.grasp import GraspProblem, GraspSolution, arrangement_at
from expert.world.slices import free_components, obstacles_at

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
    figure = new_figure(max(9.0, 2.1 * knots), 6.8)
    grid = figure.add_gridspec(2, 1, height_ratios=(1.35, 1))
    above, below = grid[0].subgridspec(1, 3), grid[1].subgridspec(1, knots)
    draw_starts(figure.add_subplot(above[0]), task, answer, runs)
    _draw_slices(figure.add_subplot(above[1]), task, answer)
    _draw_turning(figure.add_subplot(above[2]), task, runs)
    for k in range(knots):
        axes = figure.add_subplot(below[k])
        draw_moment(axes, task, answer, runs, float(k))
        axes.set_title(f"knot {k}", fontsize=LABEL)
    figure.suptitle(f"{answer.status.replace('_', ' ')}: {outcome(task, runs)}", fontsize=CAPTION)
    fingers = ("finger at the start", "finger at the end", "finger path")
    legend(figure, "starts", "goal", *fingers, "free at each knot", "limits of the cages", "executions")
    return figure


def outcome(task: GraspProblem, runs: Sweep) -> str:
    """How many runs arrived, and how far the others ended from the goal, in a reader's words."""
    arrived, count = int(runs.arrived(task.pose, task.shape.size).sum()), len(runs.poses)
    if arrived == count:
        distance, angle = NEAR * task.shape.size, np.degrees(TURNED)
        return f"all {count} random starts end at the goal, within {_length(distance)} and {angle:.2g}°"
    off, turned = runs.misses(task.pose)
    jammed = int(np.isfinite(runs.stalled).sum())
    jams = f", {jammed} jam on the way" if jammed else ""
    miss = f"up to {_length(off.max())} and {np.degrees(turned.max()):.2g}° away"
    return f"{arrived} of {count} random starts end at the goal, the others {miss}{jams}"


def _length(metres: float) -> str:
    """A length in millimetres, or in micrometres where it is small."""
    return f"{1e3 * metres:.2g} mm" if metres >= 1e-4 else f"{1e6 * metres:.2g} µm"


def draw_starts(axes: Axes, task: GraspProblem, answer: GraspSolution, runs: Sweep) -> None:
    """Start poses in grey, the goal in purple, finger paths in blue."""
    for pose in runs.poses[:SHOWN, 0]:
        axes.plot(*_outline(task, pose).T, color=START, lw=0.5, alpha=0.7, zorder=1)
    axes.fill(*_outline(task, task.pose).T, color=(*to_rgb(GOAL), 0.15), ec=GOAL, lw=1.3, zorder=2)
    for finger in np.swapaxes(answer.path, 0, 1):
        axes.plot(*finger.T, "-", color=PATH, lw=1, zorder=3)
        axes.plot(*finger[-1], "o", color=FINGER, ms=4, zorder=4)
    draw_fingers(axes, answer.path[0], around=task.pose[:2], hollow=[True] * task.count)
    plain_axes(axes, *_view(task, answer, runs))
    scale_bar(axes)
    axes.set_title("starts, goal and finger paths", fontsize=LABEL)


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
    scale_bar(axes)
    axes.set_title("free positions at the goal's orientation", fontsize=LABEL)


def _draw_turning(axes: Axes, task: GraspProblem, runs: Sweep) -> None:
    """Orientations of all runs over the path, within the half-ranges that the cages keep."""
    turned = np.degrees(runs.poses[..., 2] - task.pose[2])
    knots, limits = np.arange(len(task.half_ranges)), np.degrees(task.half_ranges)
    axes.fill_between(knots, -limits, limits, color=(*to_rgb(PATH), 0.15), lw=0)
    axes.plot(runs.s, turned.T, color=START, lw=0.5, alpha=0.7)
    axes.set_xticks(knots)
    axes.set_xlabel("knot", fontsize=LABEL)
    axes.set_ylabel("orientation [deg]", fontsize=LABEL)
    axes.tick_params(labelsize=NUMBER)
    axes.set_title("orientations and the cages' limits", fontsize=LABEL)


def draw_moment(axes: Axes, task: GraspProblem, answer: GraspSolution, runs: Sweep, s: float) -> None:
    """Some of the runs on top of each other, and the fingers, at path parameter s."""
    sample = int(np.abs(runs.s - s).argmin())
    for pose in runs.poses[:SHOWN, sample]:
        axes.fill(*_outline(task, pose).T, color=(*to_rgb(OBJECT), 0.25), lw=0)
        axes.plot(*_outline(task, pose).T, color=EDGE, lw=0.6, alpha=0.7)
    axes.plot(*_outline(task, task.pose).T, "--", color=GOAL, lw=0.8)
    draw_fingers(axes, answer.fingers(s), around=task.pose[:2])
    plain_axes(axes, *_view(task, answer, runs))
    scale_bar(axes)


def _frames(task: GraspProblem, answer: GraspSolution, runs: Sweep) -> Iterator[Image8]:
    figure = new_figure(3.6, 4.2)
    axes = figure.add_subplot()
    legend(figure, "executions", "goal", "finger")
    image = None
    for s in runs.s[:: max(1, len(runs.s) // FRAMES)]:
        axes.clear()
        draw_moment(axes, task, answer, runs, float(s))
        axes.set_title(f"knot {s:.1f} of {len(answer.path) - 1}", fontsize=LABEL)
        image = pixels(figure)
        yield image
    if image is not None:
        yield from [image] * HOLD


def _outline(task: GraspProblem, pose: Array) -> Array:
    return closed(to_world(pose, task.shape.vertices))


def _view(task: GraspProblem, answer: GraspSolution, runs: Sweep) -> tuple[Array, Array]:
    """Box around everything that the picture of the starts shows."""
    corners = to_world(runs.poses[:SHOWN, 0], task.shape.vertices).reshape(-1, 2)
    points = np.concatenate([corners, answer.path.reshape(-1, 2), _outline(task, task.pose)])
    pad = 0.05 * task.shape.size
    return room_below(points.min(axis=0) - pad, points.max(axis=0) + pad)
