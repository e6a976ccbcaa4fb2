"""Pictures of cages: the workspace, a slice of configuration space, the free component in three dimensions (Fig. 5-14 to 5-17)."""

import itertools
import os
from collections.abc import Sequence

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from expert.caging.problem import Arrangement, CageProblem
from expert.caging.solution import CageSolution
from expert.drawing.canvas import (
    EDGE,
    FINGER,
    MOVING,
    OBJECT,
    WALL,
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
from expert.verify.cage import CageReport, verify_cage
from expert.verify.free_space import free_components, obstacles_at

FREE_SPACE, OBSTACLE, PATH = "#7fb8e6", "#8d8678", "#1f5fbf"
SLICES = 61
RATE = 12.0


def draw(task: CageProblem | Arrangement, answer: CageSolution | None, path: str | os.PathLike[str]) -> None:
    """Write a picture (.png, .svg, .pdf) of workspace, slice and free component, or an animation of an escape.

    Given fingers are verified first, and an escape is drawn as such.  Raises InvalidProblem where there are no fingers.
    """
    arrangement = _arrangement(task, answer)
    report = verify_cage(arrangement)
    if suffix(path) in MOVING:
        _animate(arrangement, report, path)
    else:
        save_figure(cage_figure(arrangement, report), path)


def _arrangement(task: CageProblem | Arrangement, answer: CageSolution | None) -> Arrangement:
    if isinstance(task, Arrangement):
        return task
    if answer is None or not answer.found:
        raise InvalidProblem(
            "fingers.positions", expected="fingers to draw", got="none", remedy="solve it first"
        )
    return task.arrangement(answer.fingers)


def cage_figure(arrangement: Arrangement, report: CageReport) -> Figure:
    """Workspace, slice at the start orientation, and (x, y, theta) of the reachable component or of the escape."""
    figure = new_figure(11, 3.8)
    grid = figure.add_gridspec(1, 3)
    workspace, slice_ = (figure.add_subplot(grid[0, k]) for k in (0, 1))
    space = figure.add_subplot(grid[0, 2], projection="3d")
    draw_workspace(workspace, arrangement, report.path)
    draw_slice(slice_, arrangement, float(arrangement.pose[2]))
    _draw_component(space, arrangement, report)
    figure.suptitle(report.verdict, fontsize=10)
    return figure


def draw_workspace(axes: Axes, arrangement: Arrangement, path: Sequence[Array] | Array = ()) -> None:
    """The object at its pose, its convex pieces, fingers and walls; faint poses of an escape."""
    for pose in path[1 :: max(1, len(path) // 12)]:
        axes.plot(
            *_closed(to_world(pose, arrangement.shape.vertices)).T, color=PATH, lw=0.6, alpha=0.6, zorder=1
        )
    draw_object(axes, arrangement, arrangement.pose)
    points = [to_world(arrangement.pose, arrangement.shape.vertices), arrangement.fingers]
    _frame(axes, np.concatenate([*points, arrangement.walls.reshape(-1, 2)]))
    axes.set_title("workspace", fontsize=9)


def draw_object(axes: Axes, arrangement: Arrangement, pose: Array) -> None:
    """Object at a pose among its fingers and walls."""
    for piece in arrangement.shape.pieces:
        axes.fill(*to_world(pose, piece).T, color=OBJECT, ec="#bdb3a3", lw=0.5, zorder=2)
    axes.plot(*_closed(to_world(pose, arrangement.shape.vertices)).T, color=EDGE, lw=1, zorder=3)
    for wall in arrangement.walls:
        axes.plot(*wall.T, color=WALL, lw=4, solid_capstyle="round", zorder=2)
    axes.plot(*arrangement.fingers.T, "o", color=FINGER, ms=6, zorder=4)


def draw_slice(axes: Axes, arrangement: Arrangement, angle: float) -> None:
    """Obstacles and the component of the start pose in configuration space at one orientation [rad]."""
    obstacles = obstacles_at(arrangement, angle)
    for obstacle in obstacles:
        axes.fill(*_ring(obstacle), color=OBSTACLE, alpha=0.45, ec=EDGE, lw=0.7)
    for component in free_components(arrangement, angle):
        _fill(axes, component)
    axes.plot(*arrangement.pose[:2], "+", color=FINGER, ms=8)
    _frame(axes, shapely.get_coordinates(obstacles))
    axes.set_title(f"slice at {np.degrees(angle):.0f} deg", fontsize=9)


def _fill(axes: Axes, polygon: shapely.Polygon) -> None:
    axes.fill(*_ring(polygon), color=FREE_SPACE, ec=PATH, lw=0.8, zorder=2)
    for hole in polygon.interiors:
        axes.fill(*np.array(hole.coords).T, color="white", ec=PATH, lw=0.8, zorder=2)


def _draw_component(axes: Axes3D, arrangement: Arrangement, report: CageReport) -> None:
    """Stacked slices of the bounded free space reachable from the start, or the escape as a line."""
    if report.verdict == "caged" and report.rotation_range is not None:
        low, high = report.rotation_range
        limits = (low, high) if np.isfinite(low) else (-np.pi, np.pi)
        _stack_slices(axes, arrangement, np.linspace(*limits, SLICES))
    elif len(report.path):
        axes.plot(*report.path[:, :2].T, np.degrees(report.path[:, 2]), color=PATH, lw=1.2)
    axes.scatter(*arrangement.pose[:2], np.degrees(arrangement.pose[2]), color=FINGER, s=25, depthshade=False)
    axes.set_xlabel("x [m]", fontsize=8)
    axes.set_ylabel("y [m]", fontsize=8)
    axes.set_zlabel("θ [deg]", fontsize=8)
    axes.tick_params(labelsize=6)
    axes.locator_params(nbins=4)
    axes.set_box_aspect(None, zoom=0.85)
    axes.set_title("free component", fontsize=9)


def _stack_slices(axes: Axes3D, arrangement: Arrangement, angles: Array) -> None:
    """The components linked to the start, slice by slice in both directions (a picture, not a proof)."""
    shades = np.linspace(0.25, 0.85, len(angles))
    reached = _linked_slices(arrangement, angles)
    corners = np.concatenate(
        [shapely.get_coordinates(parts) for parts in reached if parts] or [np.zeros((1, 2))]
    )
    for angle, parts, shade in zip(angles, reached, shades, strict=True):
        faces = [
            np.column_stack([np.array(p.exterior.coords), np.full(len(p.exterior.coords), np.degrees(angle))])
            for p in parts
        ]
        colour = (0.75 * (1 - shade), 0.45 + 0.3 * shade, 0.9, 0.5)
        axes.add_collection3d(
            Poly3DCollection(faces, facecolor=colour, edgecolor=(0.1, 0.25, 0.5, 0.6), lw=0.4)
        )
    low, high = corners.min(axis=0), corners.max(axis=0)
    pad = 0.05 * float((high - low).max()) + 1e-6
    axes.set_xlim(low[0] - pad, high[0] + pad)
    axes.set_ylim(low[1] - pad, high[1] + pad)
    axes.set_zlim(np.degrees(angles[0]), np.degrees(angles[-1]))


def _linked_slices(arrangement: Arrangement, angles: Array) -> list[list[shapely.Polygon]]:
    start = int(np.abs(angles - arrangement.pose[2]).argmin())
    slices = [free_components(arrangement, float(angle), bounded=True) for angle in angles]
    here = shapely.Point(arrangement.pose[:2]).buffer(1e-3 * arrangement.shape.size)
    reached: list[list[shapely.Polygon]] = [[] for _ in angles]
    reached[start] = [p for p in slices[start] if p.intersects(here)]
    for order in (range(start + 1, len(angles)), range(start - 1, -1, -1)):
        before = reached[start]
        for k in order:
            before = reached[k] = [p for p in slices[k] if any(p.intersects(q) for q in before)]
    return reached


def _animate(arrangement: Arrangement, report: CageReport, path: str | os.PathLike[str]) -> None:
    """The object on its way out; a caged object has no motion to show."""
    if report.verdict != "escapes":
        raise InvalidProblem("output", expected="a still picture (.png) of a cage", got=str(path))
    poses = report.path
    steps = [np.linspace(a, b, 8, endpoint=False) for a, b in itertools.pairwise(poses)]
    figure = new_figure(4.5, 4.5)
    axes = figure.add_subplot()
    everything = np.concatenate([to_world(pose, arrangement.shape.vertices) for pose in poses])

    def frame(pose: Array) -> Image8:
        axes.clear()
        draw_object(axes, arrangement, pose)
        _frame(axes, np.concatenate([everything, arrangement.fingers]))
        return pixels(figure)

    save_frames((frame(pose) for pose in [*np.concatenate(steps), poses[-1]]), path, rate=RATE)


def _frame(axes: Axes, points: Array) -> None:
    low, high = points.min(axis=0), points.max(axis=0)
    pad = 0.06 * float((high - low).max())
    plain_axes(axes, low - pad, high + pad)


def _closed(points: Array) -> Array:
    return np.concatenate([points, points[:1]])


def _ring(polygon: shapely.Polygon) -> Array:
    return np.array(polygon.exterior.coords).T
