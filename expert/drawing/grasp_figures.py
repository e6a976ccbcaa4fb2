"""Panels of the thesis's figures of certified grasps: the set of starts, many poses at once, errors by strategy (Fig. 5-30, 5-31)."""

from collections.abc import Mapping

import numpy as np
import shapely
from matplotlib.axes import Axes

from expert.drawing.canvas import plain_axes, room_below
from expert.drawing.marks import EDGE, FINGER, GOAL, LABEL, PATH, START, closed, draw_fingers, scale_bar
from expert.geometry.pose import Array, to_world
from expert.problems.grasp import GraspProblem, GraspSolution, arrangement_at
from expert.world.slices import free_components, obstacles_at

REACH = 0.75
"""Half the width of a panel over the object's size."""
LEAST_ERROR = 1e-10
"""Smaller errors are rounding, and drawn as this."""


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
    draw_fingers(axes, answer.path[0], around=task.pose[:2], hollow=[True] * task.count)
    _frame(axes, task)


def draw_poses(axes: Axes, task: GraspProblem, poses: Array, fingers: Array, title: str) -> None:
    """Outlines at poses (M, 3), the goal, and fingers (N, 2)."""
    for pose in poses:
        axes.plot(*closed(to_world(pose, task.shape.vertices)).T, color=START, lw=0.5, alpha=0.7)
    axes.plot(*closed(to_world(task.pose, task.shape.vertices)).T, color=GOAL, lw=1.3)
    draw_fingers(axes, fingers, around=task.pose[:2])
    _frame(axes, task)
    axes.set_title(title, fontsize=LABEL)


def draw_errors(axes: Axes, errors: Mapping[str, Array]) -> None:
    """Boxes of end errors (M,) over the object's size, by strategy."""
    axes.boxplot([np.maximum(e, LEAST_ERROR) for e in errors.values()], showfliers=True, widths=0.5)
    axes.set_xticks([1, 2], list(errors))
    axes.set_yscale("log")
    axes.set_ylim(bottom=LEAST_ERROR / 3)
    axes.set_title("error of the end pose over the object's size\n(at the bottom: rounding)", fontsize=LABEL)
    axes.tick_params(labelsize=LABEL)


def _frame(axes: Axes, task: GraspProblem) -> None:
    reach = REACH * task.shape.size
    plain_axes(axes, *room_below(task.pose[:2] - reach, task.pose[:2] + reach))
    scale_bar(axes)
