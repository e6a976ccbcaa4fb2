"""The workspace of a cage: object, fingers, grippers, walls; or the object on its way out."""

import numpy as np
from matplotlib.axes import Axes

from expert.drawing.canvas import framed_axes
from expert.drawing.marks import (
    EDGE,
    FINGERS,
    LABEL,
    PATH,
    closed,
    draw_fingers,
    draw_object,
    draw_segment,
    scale_bar,
)
from expert.geometry.pose import Array, to_world
from expert.problems.cage import Arrangement, CageProblem
from expert.verify.cage.check import CageReport

DASHED = (0, (4, 2))


def draw_workspace(
    axes: Axes, task: CageProblem | Arrangement, arrangement: Arrangement, report: CageReport
) -> None:
    """The object at its pose among its obstacles; faint poses of an escape; which fingers belong to one gripper."""
    _draw_escape(axes, arrangement, report.path)
    if isinstance(task, CageProblem):
        for gripper in task.grippers:
            axes.plot(*arrangement.fingers[list(gripper.fingers)].T, color=EDGE, lw=1.2, ls=DASHED, zorder=4)
        if task.cost == "max_opening" and task.count == 3:
            _draw_tripod(axes, arrangement.fingers)
    draw_scene(axes, task, arrangement, arrangement.pose)
    outline = to_world(arrangement.pose, arrangement.shape.vertices)
    points = np.concatenate([outline, arrangement.fingers])
    below = points.min(axis=0) - [0, 0.1 * float(np.ptp(points, axis=0).max())]  # for the bar
    framed_axes(axes, np.vstack([points, below]), 0.06)
    scale_bar(axes)
    axes.set_title("workspace", fontsize=LABEL)


def draw_scene(axes: Axes, task: CageProblem | Arrangement, arrangement: Arrangement, pose: Array) -> None:
    """Object at a pose among its fingers, in their colours, and walls; those that stood before are square."""
    outline = to_world(pose, arrangement.shape.vertices)
    draw_object(axes, outline, [to_world(pose, piece) for piece in arrangement.shape.pieces])
    for ends in arrangement.wall_ends:
        draw_segment(axes, ends, outline)
    searched = task.count if isinstance(task, CageProblem) else len(arrangement.fingers)
    middle = arrangement.pose[:2]
    draw_fingers(axes, arrangement.fingers[:searched], around=middle, colours=FINGERS)
    fixed = arrangement.fingers[searched:]
    draw_fingers(axes, fixed, around=middle, colours=(EDGE,), style="s", first=searched)


def _draw_escape(axes: Axes, arrangement: Arrangement, path: Array) -> None:
    """A few outlines along the way out, evenly spaced, ever fainter."""
    if not len(path):
        return
    passed = lengths_along(arrangement, path)
    for share in np.linspace(0, 0.6, 6)[1:]:
        at = share * passed[-1]
        pose = np.array([np.interp(at, passed, column) for column in path.T])
        outline = closed(to_world(pose, arrangement.shape.vertices))
        axes.plot(*outline.T, color=PATH, lw=0.9, alpha=0.75 - share, zorder=1)


def lengths_along(arrangement: Arrangement, path: Array) -> Array:
    """How far the object's rim has gone [m] at each pose of a path (K, 3)."""
    steps = np.diff(path, axis=0)
    lengths = np.hypot(np.linalg.norm(steps[:, :2], axis=1), 0.5 * arrangement.shape.size * steps[:, 2])
    return np.append(0.0, np.cumsum(lengths))


def _draw_tripod(axes: Axes, fingers: Array) -> None:
    """Lines from the gripper's centre to its three fingers."""
    opening = (fingers[2, 0] - fingers[1, 0]) / np.sqrt(2)
    centre = fingers[0] - [0, opening]
    for finger in fingers[:3]:
        axes.plot(*np.stack([centre, finger]).T, color=EDGE, lw=1.2, ls=DASHED, zorder=4)
