"""Command line: python -m expert.drawing.grasp_figures 5-28|5-29|5-30|5-31 -o picture.png [--json FILE]

5-28  random polygons: starts, goals and finger paths          5-29  four objects: executions on top of each other
5-30  the set of starts by method, T and hourglass             5-31  certified against force-closure grasping, T
Exit codes: 0 drawn; 1 an object has no certified grasp, which the picture says; 2 bad input.
"""

import argparse
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rich.console import Console
from rich.progress import track

from expert.drawing.canvas import EDGE, FINGER, new_figure, plain_axes, save_figure, suffix
from expert.drawing.certified_grasp import GOAL, PATH, START, draw_moment, draw_starts, executions
from expert.errors import InvalidProblem
from expert.files import read_problem
from expert.files.document import save, writable
from expert.geometry.polygon import mass_properties
from expert.geometry.pose import Array, to_world
from expert.grasping.force_closure import best_grasp, least_distance
from expert.grasping.sweeping import sweep
from expert.grasping.synthesis import solve
from expert.problems.grasp import GraspProblem, GraspSolution, arrangement_at
from expert.verify.grasp.finger_path import FingerPath
from expert.verify.grasp.start_set import StartSet
from expert.world.named import named_shape
from expert.world.shape import Shape
from expert.world.slices import free_components, obstacles_at

PROBLEMS = Path("configs/problem/certified_grasp")
"""The random polygons of Fig. 5-28, from the folder in which the command runs."""
RANDOM, NAMED, METHODS = 12, ("T", "hourglass", "M", "I"), ("miqp1", "miqp2", "goal_cell")
RUNS, COMPARED = 60, 100
TIME_LIMIT = 300.0
"""Of the clock, for one object [s]."""
REACH = 0.2
"""A force-closure grasp is chosen among contacts that can be reached from this distance, over the object's diameter."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Draw one figure and return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m expert.drawing.grasp_figures", description=__doc__)
    parser.add_argument("figure", choices=FIGURES)
    parser.add_argument("-o", "--output", type=Path, required=True, help=".png, .svg or .pdf")
    parser.add_argument("--json", type=Path, help="write the numbers shown")
    options = parser.parse_args(arguments)
    try:
        for path in filter(None, (options.output, options.json)):
            writable(path)
        suffix(options.output)
    except InvalidProblem as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    figure, numbers = FIGURES[options.figure]()
    save_figure(figure, options.output)
    if options.json:
        save(options.json, numbers)
    print(f"picture in {options.output}")
    return 0 if all(row["status"] == "certified" for row in numbers["rows"]) else 1


def random_polygons() -> tuple[Figure, dict[str, Any]]:
    """Fig. 5-28: twelve seeded random polygons, each grasped from random starts."""
    objects = {
        f"polygon {k}": read_problem(PROBLEMS / f"random_{k:02d}.yaml").task.shape.vertices
        for k in range(RANDOM)
    }
    figure, rows = new_figure(11, 8.4), []
    panels = figure.subplots(3, 4).ravel()
    for axes, (name, vertices) in zip(panels, _watched(objects.items(), "5-28"), strict=True):
        task, answer = _solved(vertices, "goal_cell")
        rows.append({"object": name, "status": answer.status, "seconds": answer.seconds})
        if _unsolved(axes, name, answer):
            continue
        runs = executions(task, answer, RUNS)
        draw_starts(axes, task, answer, runs)
        _square(axes)
        off, turned = runs.misses(task.pose)
        arrived = int(runs.arrived(task.pose, task.shape.size).sum())
        rows[-1] |= {
            "runs": RUNS, "arrived": arrived,
            "worst_distance": float(off.max() / task.shape.size), "worst_angle_deg": _deg(turned.max()),
        }  # fmt: skip
        axes.set_title(f"{name}: {arrived} of {RUNS} starts end at the goal", fontsize=8)
    return figure, {"figure": "5-28", "rows": rows}


def overlays() -> tuple[Figure, dict[str, Any]]:
    """Fig. 5-29: executions of four objects on top of each other, knot by knot."""
    figure, rows = new_figure(10, 8.2), []
    grid = figure.subplots(len(NAMED), 5)
    for line, name in zip(grid, _watched(NAMED, "5-29"), strict=True):
        task, answer = _solved(named_shape(name), "goal_cell")
        rows.append({"object": name, "status": answer.status, "seconds": answer.seconds})
        if _unsolved(line[0], name, answer):
            for axes in line:
                axes.set_axis_off()
            continue
        runs = executions(task, answer, RUNS)
        for k, axes in enumerate(line):
            draw_moment(axes, task, answer, runs, float(k))
            _square(axes)
        line[0].set_ylabel(name, fontsize=9)
    for k, axes in enumerate(grid[0]):
        axes.set_title(f"knot {k}", fontsize=8)
    return figure, {"figure": "5-29", "rows": rows}


def attraction() -> tuple[Figure, dict[str, Any]]:
    """Fig. 5-30: the set of starts at the goal's orientation, verified, by method."""
    names = NAMED[:2]
    figure, rows = new_figure(9, 6.4), []
    grid = figure.subplots(len(names), len(METHODS))
    cases = [(i, j, name, method) for i, name in enumerate(names) for j, method in enumerate(METHODS)]
    for i, j, name, method in _watched(cases, "5-30"):
        task, answer = _solved(named_shape(name), method)
        rows.append({"object": name, "method": method, "status": answer.status, "seconds": answer.seconds})
        if len(answer.path) == 0:
            _unsolved(grid[i, j], f"{name}, {method}", answer)
            continue
        share = start_area(task, answer) / mass_properties(task.shape.vertices).area
        rows[-1]["area"] = share
        draw_start_set(grid[i, j], task, answer)
        grid[i, j].set_title(
            f"{name}, {method}: {100 * share:.2f} % of the object\n{answer.status}", fontsize=8
        )
    return figure, {"figure": "5-30", "rows": rows}


def start_area(task: GraspProblem, answer: GraspSolution) -> float:
    """Area [m^2] of the verified starts at the goal's orientation; 0 where the goal is not caged."""
    return StartSet(FingerPath(task.shape, task.pose, answer.path)).area


def draw_start_set(axes: Axes, task: GraspProblem, answer: GraspSolution) -> None:
    """The object at its goal, fingers at the start, and in blue where its reference point may be, at true scale."""
    first = arrangement_at(task, answer, 0.0)
    angle, here = float(task.pose[2]), shapely.Point(task.pose[:2])
    for obstacle in obstacles_at(first.shape, first.fingers, first.wall_ends, angle):
        axes.plot(*np.array(obstacle.exterior.coords).T, color=EDGE, lw=0.4, alpha=0.5)
    axes.plot(*_closed(to_world(task.pose, task.shape.vertices)).T, color=GOAL, lw=1.2)
    for part in free_components(first.shape, first.fingers, first.wall_ends, angle):
        if part.distance(here) < 1e-6 * task.shape.size:
            axes.fill(*np.array(part.exterior.coords).T, color=PATH, lw=0.8, zorder=3)
    for finger in np.swapaxes(answer.path, 0, 1):
        axes.plot(*finger.T, color=FINGER, lw=0.8)
    axes.plot(*answer.path[0].T, "o", color=FINGER, ms=4)
    reach = 0.75 * task.shape.size
    plain_axes(axes, task.pose[:2] - reach, task.pose[:2] + reach)


def against_force_closure() -> tuple[Figure, dict[str, Any]]:
    """Fig. 5-31: the same starts, grasped with a certificate and by contacts chosen for their quality."""
    task, answer = _solved(named_shape(NAMED[0]), "goal_cell")
    figure = new_figure(10, 5.2)
    left, middle, right = figure.subfigures(1, 3, squeeze=False, width_ratios=(1, 1, 1.2))[0]
    noise = left.subplots()
    if _unsolved(noise, NAMED[0], answer):
        return figure, {"figure": "5-31", "rows": [{"object": NAMED[0], "status": answer.status}]}
    starts, errors, ends = force_closure_comparison(task, answer, COMPARED)
    _draw_poses(noise, task, starts[:30], np.empty((0, 2)), "starts")
    for axes, name in zip(middle.subplots(2, 1), errors, strict=True):
        _draw_poses(axes, task, ends[name][0][:30], ends[name][1], f"ends: {name}")
    box = right.subplots()
    box.boxplot([np.maximum(e, 1e-17) for e in errors.values()], showfliers=True, widths=0.5)
    box.set_xticks([1, 2], list(errors))
    box.set_yscale("log")
    box.set_title("L1 error of the end pose over the object's size", fontsize=8)
    box.tick_params(labelsize=8)
    row = {"object": NAMED[0], "status": answer.status, "runs": COMPARED}
    row |= {f"{key}_{name.replace(' ', '_').replace('-', '_')}": float(f(e))
            for name, e in errors.items() for key, f in (("median", np.median), ("worst", np.max))}  # fmt: skip
    return figure, {"figure": "5-31", "rows": [row]}


def force_closure_comparison(
    task: GraspProblem, answer: GraspSolution, count: int
) -> tuple[Array, dict[str, Array], dict[str, tuple[Array, Array]]]:
    """Starts (M, 3); by strategy the errors of the end poses (M,) over the object's size, and end poses with fingers."""
    certified = executions(task, answer, count)
    starts = certified.poses[:, 0]
    grasp = best_grasp(task.shape, REACH * task.shape.size)
    path = grasp.approach(task.pose, least_distance(task.shape, grasp, task.pose, starts))
    naive = sweep(task.shape, path, starts, goal=task.pose)
    runs = {"force closure": (naive, path[-1]), "certified": (certified, answer.path[-1])}
    errors = {name: pose_errors(task, run.ends) for name, (run, _) in runs.items()}
    return starts, errors, {name: (run.ends, fingers) for name, (run, fingers) in runs.items()}


def pose_errors(task: GraspProblem, ends: Array) -> Array:
    """|dx| + |dy| + r |dtheta| over the object's size, r its radius of gyration, of poses (M, 3)."""
    plate = mass_properties(task.shape.vertices)
    gyration = float(np.sqrt(plate.second_moment / plate.area))
    return np.asarray(np.abs(ends - task.pose) @ np.array([1, 1, gyration]) / task.shape.size)


def _draw_poses(axes: Axes, task: GraspProblem, poses: Array, fingers: Array, title: str) -> None:
    for pose in poses:
        axes.plot(*_closed(to_world(pose, task.shape.vertices)).T, color=START, lw=0.5, alpha=0.7)
    axes.plot(*_closed(to_world(task.pose, task.shape.vertices)).T, color=GOAL, lw=1.3)
    axes.plot(*fingers.T, "o", color=FINGER, ms=4)
    reach = 0.72 * task.shape.size
    plain_axes(axes, task.pose[:2] - reach, task.pose[:2] + reach)
    axes.set_title(title, fontsize=8)


def _solved(vertices: Array, method: str) -> tuple[GraspProblem, GraspSolution]:
    cost = "acceleration" if method == "miqp1" else "attraction"
    task = GraspProblem(shape=Shape(vertices=vertices), pose=np.zeros(3), cost=cost)  # type: ignore[arg-type]
    return task, solve(task, method=method, time_limit=TIME_LIMIT)  # type: ignore[arg-type]


def _unsolved(axes: Axes, name: str, answer: GraspSolution) -> bool:
    """Say so in the panel of an object that has no certified grasp."""
    if answer.found:
        return False
    axes.set_axis_off()
    axes.set_title(f"{name}: {answer.status}", fontsize=8)
    return True


def _square(axes: Axes) -> None:
    """Make a panel's view a square about its middle, so that all panels are of one size."""
    low, high = np.transpose([axes.get_xlim(), axes.get_ylim()])
    middle, half = 0.5 * (low + high), 0.5 * (high - low).max()
    plain_axes(axes, middle - half, middle + half)


def _watched(items: Iterable[Any], what: str) -> Iterable[Any]:
    console = Console(stderr=True)
    return track(list(items), what, console=console, disable=not console.is_terminal)


def _closed(points: Array) -> Array:
    return np.concatenate([points, points[:1]])


def _deg(angle: float) -> float:
    return float(np.degrees(angle))


FIGURES: dict[str, Callable[[], tuple[Figure, dict[str, Any]]]] = {
    "5-28": random_polygons,
    "5-29": overlays,
    "5-30": attraction,
    "5-31": against_force_closure,
}

if __name__ == "__main__":
    sys.exit(main())
