"""A slice of configuration space: what each obstacle forbids, what is free about the start, and a loop around it."""

import numpy as np
import shapely
from matplotlib.axes import Axes

from expert.drawing.canvas import framed_axes
from expert.drawing.marks import (
    EDGE,
    ELSEWHERE,
    FREE,
    HALO,
    LABEL,
    NUMBER,
    ORIGIN,
    WALL,
    finger_colour,
    scale_bar,
)
from expert.geometry.pose import Array
from expert.problems.cage import Arrangement
from expert.world.slices import free_components, obstacles_at

SMALL = 0.1
"""A free component below this share of the picture is shown once more, enlarged."""
HALVINGS, MIDDLE = 12, 0.7
"""Of the search for how far from the free component obstacles close around it; the loop is drawn at this share of it."""


def draw_slice(axes: Axes, arrangement: Arrangement) -> None:
    """Positions of the reference point at the start orientation: obstacles in their fingers' colours, the bounded free component.

    Dashed: a closed curve within the obstacles around the start, where there is one (Thesis Fig. 5-16).
    """
    angle = float(arrangement.pose[2])
    obstacles = obstacles_at(arrangement.shape, arrangement.fingers, arrangement.wall_ends, angle)
    free = free_components(arrangement.shape, arrangement.fingers, arrangement.wall_ends, angle)
    _draw_obstacles(axes, arrangement, obstacles, numbered=True)
    _draw_free(axes, arrangement, free)
    start = shapely.Point(arrangement.pose[:2]).buffer(1e-3 * arrangement.shape.size)
    around = [p for p in free if p.intersects(start)]
    for component in around:
        loop = enclosing_loop(component, obstacles)
        axes.plot(*loop.T, color=ORIGIN, lw=1.3, ls=(0, (3, 2)), zorder=5)
    corners = shapely.get_coordinates(obstacles)
    framed_axes(axes, corners, 0.04)
    scale_bar(axes)
    axes.set_title(f"configuration space at θ = {np.degrees(angle):.0f}°", fontsize=LABEL)
    if around:
        reach = np.abs(shapely.get_coordinates(around) - arrangement.pose[:2]).max()
        if reach < SMALL * np.ptp(corners, axis=0).max():
            _enlarge(axes, arrangement, obstacles, free, 1.5 * float(reach))


def enclosing_loop(component: shapely.Polygon, obstacles: list[shapely.Polygon]) -> Array:
    """Closed curve (k, 2) [m] within the obstacles around a bounded free component, as far from it as they are thick."""
    solid = shapely.union_all(obstacles)
    low, high = 0.0, float(np.ptp(shapely.get_coordinates(obstacles), axis=0).max())
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        ring = component.buffer(middle).exterior
        low, high = (middle, high) if solid.covers(ring) else (low, middle)
    return np.array(component.buffer(MIDDLE * low).exterior.coords)


def _draw_obstacles(
    axes: Axes, arrangement: Arrangement, obstacles: list[shapely.Polygon], *, numbered: bool
) -> None:
    for k, obstacle in enumerate(obstacles):
        colour = finger_colour(k) if k < len(arrangement.fingers) else WALL
        edge = colour if k < len(arrangement.fingers) else EDGE
        ring = np.array(obstacle.exterior.coords).T
        axes.fill(*ring, color=colour, alpha=0.28, lw=0, zorder=1)
        axes.plot(*ring, color=edge, lw=0.9, alpha=0.9, zorder=2)
        if numbered and k < len(arrangement.fingers):
            x, y = obstacle.representative_point().coords[0]
            axes.text(x, y, f"{k}", ha="center", color=colour, fontsize=NUMBER, path_effects=HALO, zorder=8)


def _draw_free(axes: Axes, arrangement: Arrangement, free: list[shapely.Polygon]) -> None:
    start = shapely.Point(arrangement.pose[:2]).buffer(1e-3 * arrangement.shape.size)
    for component in free:
        colour = FREE if component.intersects(start) else ELSEWHERE
        axes.fill(*np.array(component.exterior.coords).T, color=colour, ec=FREE, lw=0.9, zorder=3)
        for hole in component.interiors:
            axes.fill(*np.array(hole.coords).T, color="white", ec=FREE, lw=0.8, zorder=3)
    axes.plot(*arrangement.pose[:2], "+", color=ORIGIN, ms=8, mew=1.4, zorder=6)


def _enlarge(
    axes: Axes,
    arrangement: Arrangement,
    obstacles: list[shapely.Polygon],
    free: list[shapely.Polygon],
    reach: float,
) -> None:
    """The surroundings of the start in a window of their own, in the corner that hides least."""
    low, high = (np.array(limits) for limits in zip(axes.get_xlim(), axes.get_ylim(), strict=True))
    union = shapely.union_all(obstacles)

    def hidden(corner: tuple[float, float]) -> float:
        a = low + np.array(corner) * (high - low)
        return float(union.intersection(shapely.box(*a, *(a + 0.36 * (high - low)))).area)

    corner = min([(0.62, 0.62), (0.02, 0.62), (0.62, 0.02)], key=hidden)
    window = axes.inset_axes((*corner, 0.36, 0.36), zorder=7)
    _draw_obstacles(window, arrangement, obstacles, numbered=False)
    _draw_free(window, arrangement, free)
    start = arrangement.pose[:2]
    framed_axes(window, np.stack([start - reach, start + reach]), 0.0)
    scale_bar(window)
    for spine in window.spines.values():
        spine.set_color(EDGE)
    axes.indicate_inset_zoom(window, edgecolor=EDGE, alpha=0.7)
