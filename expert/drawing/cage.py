"""Pictures of cages: the workspace, a slice of configuration space, the free component in three dimensions (Fig. 5-14 to 5-17)."""

import itertools
import os
from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from expert.drawing.cage_component import draw_component
from expert.drawing.cage_slice import draw_slice
from expert.drawing.cage_workspace import draw_scene, draw_workspace, lengths_along
from expert.drawing.canvas import (
    MOVING,
    Image8,
    framed_axes,
    new_figure,
    pixels,
    save_figure,
    save_frames,
    suffix,
)
from expert.drawing.marks import CAPTION, LABEL, legend, scale_bar
from expert.errors import InvalidProblem
from expert.geometry.pose import to_world
from expert.problems.cage import Arrangement, CageProblem, CageSolution
from expert.verify.cage.check import verify_cage
from expert.verify.cage.report import CageReport
from expert.world.slices import free_components

VIEWS = ("workspace", "slice", "component")
RATE = 12.0


def draw(
    task: CageProblem | Arrangement,
    answer: CageSolution | None,
    path: str | os.PathLike[str],
    view: str = "all",
) -> None:
    """Write a picture (.png, .svg, .pdf) of one view or of all, or an animation of an escape.

    The fingers are verified first, and an escape is drawn as such.  Raises InvalidProblem where there are no fingers.
    """
    if view not in ("all", *VIEWS):
        raise InvalidProblem("view", expected=" or ".join(("all", *VIEWS)), got=view)
    arrangement = _arrangement(task, answer)
    report = verify_cage(arrangement)
    if suffix(path) in MOVING:
        _animate(task, arrangement, report, path)
    else:
        views = VIEWS if view == "all" else (view,)
        save_figure(cage_figure(task, arrangement, report, views), path)


def cage_figure(
    task: CageProblem | Arrangement, arrangement: Arrangement, report: CageReport, views: Sequence[str]
) -> Figure:
    """The views side by side, under what the checker says."""
    figure = new_figure(4.2 * len(views), 4.6)
    for k, name in enumerate(views):
        place = (1, len(views), k + 1)
        if name == "workspace":
            draw_workspace(figure.add_subplot(*place), task, arrangement, report)
        elif name == "slice":
            draw_slice(figure.add_subplot(*place), arrangement)
        else:
            draw_component(figure.add_subplot(*place, projection="3d"), arrangement, report)
    figure.suptitle(_caption(report), fontsize=CAPTION)
    legend(figure, *_shown(task, arrangement, report, views))
    return figure


def _caption(report: CageReport) -> str:
    """The verdict in a reader's words."""
    if report.verdict == "caged" and report.rotation_range is not None:
        low, high = np.degrees(report.rotation_range)
        turns = f"it can turn from {low:.3g}° to {high:.3g}°" if np.isfinite(low) else "it can turn freely"
        return f"caged: {turns}, and never leaves"
    if report.verdict == "escapes":
        return f"escapes, on a path of {len(report.path)} poses"
    return f"unknown: not decided down to cells of {2 * np.degrees(report.resolution):.2g}°"


def _shown(
    task: CageProblem | Arrangement, arrangement: Arrangement, report: CageReport, views: Sequence[str]
) -> list[str]:
    """Entries of the legend."""
    names = []
    if "workspace" in views:
        names += ["object", "finger, one colour each"]
        if isinstance(task, CageProblem):
            names += ["fixed finger"] * bool(len(task.fixed))
            tripod = task.cost == "max_opening" and task.count == 3
            names += ["gripper"] * (bool(task.grippers) or tripod)
        names += ["wall"] * bool(arrangement.walls)
    if "slice" in views:
        walls, angle = arrangement.wall_ends, float(arrangement.pose[2])
        parts = len(free_components(arrangement.shape, arrangement.fingers, walls, angle))
        names += [
            "obstacle of a finger",
            *["free around the start", "closed curve in obstacles"][: 2 * parts],
        ]
        names += ["free elsewhere"] * (parts > 1)
    names += ["start"] * bool(set(views) - {"workspace"})
    return names + ["way out"] * bool(len(report.path) and set(views) - {"slice"})


def _arrangement(task: CageProblem | Arrangement, answer: CageSolution | None) -> Arrangement:
    if isinstance(task, Arrangement):
        return task
    if answer is None or not answer.found:
        raise InvalidProblem(
            "fingers.positions", expected="fingers to draw", got="none", remedy="solve it first"
        )
    return task.arrangement(answer.fingers)


def _animate(
    task: CageProblem | Arrangement,
    arrangement: Arrangement,
    report: CageReport,
    path: str | os.PathLike[str],
) -> None:
    """The object on its way out; a caged object has no motion to show."""
    if report.verdict != "escapes":
        raise InvalidProblem("output", expected="a still picture (.png) of a cage", got=str(path))
    steps = [np.linspace(a, b, 8, endpoint=False) for a, b in itertools.pairwise(report.path)]
    poses = np.concatenate([*steps, report.path[-1:]])
    passed = lengths_along(arrangement, poses)
    corners = to_world(poses, arrangement.shape.vertices).reshape(-1, 2)
    figure = new_figure(4.5, 5.1)
    axes = figure.add_subplot()
    figure.suptitle(_caption(report), fontsize=CAPTION)
    legend(figure, *_shown(task, arrangement, report, ["workspace"])[:-1])

    def frame(k: int) -> Image8:
        axes.clear()
        draw_scene(axes, task, arrangement, poses[k])
        framed_axes(axes, np.concatenate([corners, arrangement.fingers]))
        scale_bar(axes)
        axes.set_title(f"{100 * passed[k] / passed[-1]:.0f} % of the way out", fontsize=LABEL)
        return pixels(figure)

    save_frames((frame(k) for k in range(len(poses))), path, rate=RATE)
