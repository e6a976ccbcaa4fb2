"""The free component of the start pose in three dimensions, or the way out of it."""

import numpy as np
import shapely
from matplotlib import colormaps
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

from expert.drawing.marks import LABEL, NUMBER, ORIGIN, PATH
from expert.geometry.pose import Array
from expert.problems.cage import Arrangement
from expert.verify.cage.report import CageReport
from expert.world.slices import free_components

SLICES = 49
MILLIMETRES = 1e3


def draw_component(axes: Axes3D, arrangement: Arrangement, report: CageReport) -> None:
    """What the object can reach, relative to its start pose: stacked slices coloured by orientation; or an escape as a line."""
    if report.verdict == "caged" and report.rotation_range is not None:
        low, high = report.rotation_range
        limits = (low, high) if np.isfinite(low) else (-np.pi, np.pi)
        _stack_slices(axes, arrangement, _occupied(arrangement, np.linspace(*limits, SLICES)))
        axes.set_title("all that the object can reach", fontsize=LABEL)
    elif len(report.path):
        steps = report.path - arrangement.pose
        axes.plot(*MILLIMETRES * steps[:, :2].T, np.degrees(steps[:, 2]), color=PATH, lw=1.4)
        axes.set_title("way out", fontsize=LABEL)
    axes.computed_zorder = False  # the start lies inside
    axes.scatter(0, 0, 0, color=ORIGIN, marker="+", s=70, linewidths=1.6, depthshade=False, zorder=10)
    for axis, label in ((axes.xaxis, "Δx [mm]"), (axes.yaxis, "Δy [mm]"), (axes.zaxis, "Δθ [deg]")):
        axis.set_label_text(label, fontsize=LABEL)
        axis.set_pane_color((0.97, 0.97, 0.97, 1.0))
    axes.tick_params(labelsize=NUMBER, pad=0)
    axes.locator_params(nbins=5)
    axes.view_init(elev=22, azim=-58)
    axes.set_box_aspect((1, 1, 1), zoom=0.88)


def _stack_slices(axes: Axes3D, arrangement: Arrangement, angles: Array) -> None:
    """The components linked to the start, slice by slice in both directions (a picture, not a proof)."""
    reached = linked_slices(arrangement, angles)
    heights = np.degrees(angles - arrangement.pose[2])
    shades = colormaps["viridis"](np.linspace(0.12, 0.95, len(angles)))
    for height, parts, shade in zip(heights, reached, shades, strict=True):
        if parts:
            rings = [_lifted(ring, arrangement, height) for p in parts for ring in (p.exterior, *p.interiors)]
            solid = [_lifted(p.exterior, arrangement, height) for p in parts if not p.interiors]
            axes.add_collection3d(Poly3DCollection(solid, facecolor=(*shade[:3], 0.35), edgecolor="none"))
            axes.add_collection3d(Line3DCollection(rings, color=(*(0.75 * shade[:3]), 0.8), lw=0.7))
    occupied = heights[[bool(parts) for parts in reached]]
    corners = shapely.get_coordinates([p for parts in reached for p in parts])
    corners = MILLIMETRES * (corners - arrangement.pose[:2]) if len(corners) else np.zeros((1, 2))
    low, high = corners.min(axis=0), corners.max(axis=0)
    pad = 0.04 * np.maximum(high - low, 1e-3)
    axes.set_xlim(low[0] - pad[0], high[0] + pad[0])
    axes.set_ylim(low[1] - pad[1], high[1] + pad[1])
    axes.set_zlim(occupied.min(initial=0.0) - 0.1, occupied.max(initial=0.0) + 0.1)


def _occupied(arrangement: Arrangement, angles: Array) -> Array:
    """As many orientations, spread only over those that are reached: the verifier's range may be wider."""
    reached = linked_slices(arrangement, angles)
    used = np.flatnonzero([bool(parts) for parts in reached])
    if not len(used):
        return angles
    return np.linspace(angles[max(used[0] - 1, 0)], angles[min(used[-1] + 1, len(angles) - 1)], len(angles))


def _lifted(ring: shapely.LinearRing, arrangement: Arrangement, height: float) -> Array:
    """The ring (k, 3), relative to the start [mm, deg]."""
    points = MILLIMETRES * (np.array(ring.coords) - arrangement.pose[:2])
    return np.column_stack([points, np.full(len(points), height)])


def linked_slices(arrangement: Arrangement, angles: Array) -> list[list[shapely.Polygon]]:
    """At each orientation the free components that a chain of overlapping ones links to the start."""
    start = int(np.abs(angles - arrangement.pose[2]).argmin())
    slices = [
        free_components(arrangement.shape, arrangement.fingers, arrangement.wall_ends, float(angle))
        for angle in angles
    ]
    here = shapely.Point(arrangement.pose[:2]).buffer(1e-3 * arrangement.shape.size)
    reached: list[list[shapely.Polygon]] = [[] for _ in angles]
    reached[start] = [p for p in slices[start] if p.intersects(here)]
    for order in (range(start + 1, len(angles)), range(start - 1, -1, -1)):
        before = reached[start]
        for k in order:
            before = reached[k] = [p for p in slices[k] if any(p.intersects(q) for q in before)]
    return reached
