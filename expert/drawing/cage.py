"""Pictures of cages: the workspace, a slice of configuration space, the free component in three dimensions (Fig. 5-14 to 5-17)."""

import itertools
import os

import numpy as np

from expert.drawing.cage_component import draw_component
from expert.drawing.cage_slice import draw_slice
from expert.drawing.cage_workspace import draw_object, draw_workspace
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
from expert.errors import InvalidProblem
from expert.geometry.pose import Array, to_world
from expert.problems.cage import Arrangement, CageProblem, CageSolution
from expert.verify.cage.check import verify_cage
from expert.verify.cage.report import CageReport

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
    views = VIEWS if view == "all" else (view,)
    arrangement = _arrangement(task, answer)
    report = verify_cage(arrangement)
    if suffix(path) in MOVING:
        _animate(arrangement, report, path)
        return
    figure = new_figure(4.2 * len(views), 4.0)
    for k, name in enumerate(views):
        place = (1, len(views), k + 1)
        if name == "workspace":
            draw_workspace(figure.add_subplot(*place), task, arrangement, report)
        elif name == "slice":
            draw_slice(figure.add_subplot(*place), arrangement)
        else:
            draw_component(figure.add_subplot(*place, projection="3d"), arrangement, report)
    save_figure(figure, path, colours=128)


def _arrangement(task: CageProblem | Arrangement, answer: CageSolution | None) -> Arrangement:
    if isinstance(task, Arrangement):
        return task
    if answer is None or not answer.found:
        raise InvalidProblem(
            "fingers.positions", expected="fingers to draw", got="none", remedy="solve it first"
        )
    return task.arrangement(answer.fingers)


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
        framed_axes(axes, np.concatenate([everything, arrangement.fingers]))
        return pixels(figure)

    save_frames((frame(pose) for pose in [*np.concatenate(steps), poses[-1]]), path, rate=RATE)
