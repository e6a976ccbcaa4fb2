"""Panels of the thesis's figures of certified grasps: the set of starts, many poses at once, errors by strategy (Fig. 5-30, 5-31)."""

from collections.abc import Mapping

import numpy as np
import shapely
from matplotlib.axes import Axes

from expert.drawing.canvas import EDGE, FINGER, closed, plain_axes
from expert.drawing.certified_grasp import GOAL, PATH, START
from expert.geometry.pose import Array, to_world
from expert.problems.grasp import GraspProblem, GraspSolution, arrangement_at
from expert.world.slices import free_components, obstacles_at

LEAST_ERROR = 1e-17
"""Zero on a logarithmic axis."""


def draw_start_set(axes: Axes, task: GraspProblem, answer: GraspSolution) -> None:
    """The object at its goal, fingers at the start, and in blue where its reference point may be, at true scale."""
    first = arrangement_at(task, answer, 0.0)
    angle, here = float(task.pose[2]), shapely.Point(task.pose[:2])
    for obstacle in obstacles_at(first.shape, first.fingers, first.wall_ends, angle):
        axes.plot(*np.array(obstacle.exterior.coords).T, color=EDGE, lw=0.4, alpha=0.5)
    axes.plot(*closed(to_world(task.pose, task.shape.vertices)).T, color=GOAL, lw=1.2)
    for part in free_components(first.shape, first.fingers, first.wall_ends, angle):
        if part.distance(here) < 1e-6 * task.shape.size:
            axes.fill(*np.array(part.exterior.coords).T, color=PATH, lw=0.8, zorder=3)
    for finger in np.swapaxes(answer.path, 0, 1):
        axes.plot(*finger.T, color=FINGER, lw=0.8)
    axes.plot(*answer.path[0].T, "o", color=FINGER, ms=4)
    reach = 0.75 * task.shape.size
    plain_axes(axes, task.pose[:2] - reach, task.pose[:2] + reach)


def draw_poses(axes: Axes, task: GraspProblem, poses: Array, fingers: Array, title: str) -> None:
    """Outlines at poses (M, 3), the goal, and fingers (N, 2)."""
    for pose in poses:
        axes.plot(*closed(to_world(pose, task.shape.vertices)).T, color=START, lw=0.5, alpha=0.7)
    axes.plot(*closed(to_world(task.pose, task.shape.vertices)).T, color=GOAL, lw=1.3)
    axes.plot(*fingers.T, "o", color=FINGER, ms=4)
    reach = 0.72 * task.shape.size
    plain_axes(axes, task.pose[:2] - reach, task.pose[:2] + reach)
    axes.set_title(title, fontsize=8)


def draw_errors(axes: Axes, errors: Mapping[str, Array]) -> None:
    """Boxes of end errors (M,) over the object's size, by strategy."""
    axes.boxplot([np.maximum(e, LEAST_ERROR) for e in errors.values()], showfliers=True, widths=0.5)
    axes.set_xticks([1, 2], list(errors))
    axes.set_yscale("log")
    axes.set_title("L1 error of the end pose over the object's size", fontsize=8)
    axes.tick_params(labelsize=8)
