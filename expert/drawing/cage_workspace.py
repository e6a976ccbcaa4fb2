"""The workspace of a cage: object, fingers, grippers, walls; or the object on its way out."""

import numpy as np
from matplotlib.axes import Axes

from expert.drawing.canvas import EDGE, OBJECT, WALL, closed, framed_axes, scale_bar
from expert.geometry.pose import Array, cross, to_world
from expert.problems.cage import Arrangement, CageProblem
from expert.verify.cage.report import CageReport

FINGERS = ("#c8102e", "#1a8a3c", "#7a4fb5", "#d9822b", "#0e8c9c", "#b5527a", "#6b6b2f")
"""One colour each, here and in slices."""
PATH = "#1f5fbf"


def finger_colour(k: int) -> str:
    """The colour of finger k."""
    return FINGERS[k % len(FINGERS)]


def draw_workspace(
    axes: Axes, task: CageProblem | Arrangement, arrangement: Arrangement, report: CageReport
) -> None:
    """The object at its pose among its obstacles; faint poses of an escape; which fingers belong to one gripper."""
    _draw_escape(axes, arrangement, report.path)
    if isinstance(task, CageProblem):
        for gripper in task.grippers:
            axes.plot(
                *arrangement.fingers[list(gripper.fingers)].T, color=EDGE, lw=1.2, ls=(0, (4, 2)), zorder=4
            )
        if task.cost == "max_opening" and task.count == 3:
            _draw_tripod(axes, arrangement.fingers)
    draw_object(axes, arrangement, arrangement.pose)
    searched = task.count if isinstance(task, CageProblem) else len(arrangement.fingers)
    axes.plot(*arrangement.fingers[searched:].T, "s", color=EDGE, ms=7, mec="white", mew=0.8, zorder=6)
    outline = to_world(arrangement.pose, arrangement.shape.vertices)
    points = np.concatenate([outline, arrangement.fingers])
    below = points.min(axis=0) - [0, 0.1 * float(np.ptp(points, axis=0).max())]  # for the bar
    framed_axes(axes, np.vstack([points, below]), 0.06)
    scale_bar(axes)
    axes.set_title(f"workspace: {report.verdict}", fontsize=10)


def _draw_escape(axes: Axes, arrangement: Arrangement, path: Array) -> None:
    """A few outlines along the way out, evenly spaced, ever fainter."""
    if not len(path):
        return
    steps = np.diff(path, axis=0)
    lengths = np.hypot(np.linalg.norm(steps[:, :2], axis=1), 0.5 * arrangement.shape.size * steps[:, 2])
    passed = np.append(0.0, np.cumsum(lengths))
    for share in np.linspace(0, 0.6, 6)[1:]:
        at = share * passed[-1]
        pose = np.array([np.interp(at, passed, column) for column in path.T])
        outline = closed(to_world(pose, arrangement.shape.vertices))
        axes.plot(*outline.T, color=PATH, lw=0.9, alpha=0.75 - share, zorder=1)


def draw_object(axes: Axes, arrangement: Arrangement, pose: Array) -> None:
    """Object at a pose, its convex pieces faintly outlined, among its fingers and walls."""
    for piece in arrangement.shape.pieces:
        axes.fill(*to_world(pose, piece).T, color=OBJECT, ec="#c6bdae", lw=0.6, zorder=2)
    outline = to_world(pose, arrangement.shape.vertices)
    axes.plot(*closed(outline).T, color=EDGE, lw=1.2, zorder=3)
    for wall in arrangement.wall_ends:
        _draw_wall(axes, wall, outline)
    for k, finger in enumerate(arrangement.fingers):
        axes.plot(*finger, "o", color=finger_colour(k), ms=8, mec="white", mew=0.8, zorder=5)


def _draw_wall(axes: Axes, wall: Array, outline: Array) -> None:
    """A line, with a grey band on the side that faces away from the object."""
    along = wall[1] - wall[0]
    away = np.array([along[1], -along[0]]) / np.linalg.norm(along)
    if np.median(cross(along, outline - wall[0])) < 0:
        away = -away
    depth = 0.05 * float(np.ptp(outline, axis=0).max())
    band = np.concatenate([wall, wall[::-1] + depth * away])
    axes.fill(*band.T, facecolor=WALL, ec="#8f959d", hatch="////", lw=0, zorder=1)
    axes.plot(*wall.T, color=EDGE, lw=1.4, zorder=3)


def _draw_tripod(axes: Axes, fingers: Array) -> None:
    """Lines from the gripper's centre to its three fingers."""
    opening = (fingers[2, 0] - fingers[1, 0]) / np.sqrt(2)
    centre = fingers[0] - [0, opening]
    for finger in fingers[:3]:
        axes.plot(*np.stack([centre, finger]).T, color=EDGE, lw=1.2, ls=(0, (4, 2)), zorder=4)
