"""Film strips and animations of plans of pushes: an object on a table, seen from above."""

import os
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from expert.drawing.canvas import (
    MOVING,
    Image8,
    new_figure,
    pixels,
    plain_axes,
    room_below,
    save_figure,
    save_frames,
    suffix,
)
from expert.drawing.marks import (
    CAPTION,
    EDGE,
    FINGER,
    FINGER_FORCE,
    GOAL,
    HATCH,
    LABEL,
    PATH,
    START,
    WALL,
    closed,
    draw_arrow,
    draw_object,
    legend,
    scale_bar,
)
from expert.errors import InvalidProblem
from expert.geometry.pose import Array
from expert.problems.push import Push, PushPlan, PushProblem
from expert.verify.push.law import support
from expert.verify.push.motion import course

COLUMNS = 4
RATE, FRAMES = 12.0, 220
"""Of an animation: pictures per second, and at most so many; a longer plan is shown faster."""
SLOWEST = 1.0


@dataclass(frozen=True, kw_only=True)
class Moment:
    """What one picture shows: time [s], the object's pose (3,) and the finger (2,)."""

    time: float
    pose: Array
    finger: Array


def draw(task: PushProblem, plan: PushPlan | None, path: str | os.PathLike[str]) -> None:
    """Write a film strip (.png, .svg, .pdf: one panel per push) or an animation (.gif, .mp4).

    An answer without a plan shows start and goal.  Raises InvalidProblem for any other suffix, and without answer.
    """
    if plan is None:
        raise InvalidProblem(
            "solution", expected="a solution file", got="a problem file", remedy="solve it first"
        )
    if suffix(path) in MOVING:
        save_frames(_frames(task, plan), path, rate=RATE)
    else:
        save_figure(film_strip(task, plan), path)


def film_strip(task: PushProblem, plan: PushPlan) -> Figure:
    """One panel per push: where the finger goes, where it pushes, and where the object was and is."""
    count = max(len(plan.pushes), 1)
    columns, rows = min(count, COLUMNS), -(-count // COLUMNS)
    low, high = _view(task)
    height = 2.6 * (high - low)[1] / (high - low)[0]
    figure = new_figure(columns * 2.6, rows * (height + 0.25) + 0.75)
    pose, finger = task.start, task.finger.start
    for k, axes in enumerate(figure.subplots(rows, columns, squeeze=False).ravel()):
        if k >= count:
            axes.set_axis_off()
            continue
        _draw_scene(axes, task)
        if k >= len(plan.pushes):
            draw_object(axes, task.outline(pose))
            _draw_finger(axes, task, finger)
            continue
        push = plan.pushes[k]
        axes.plot(*closed(task.outline(pose)).T, color=START, lw=0.9, zorder=3)
        draw_object(axes, task.outline(push.pose))
        _draw_push(axes, task, finger, push)
        axes.set_title(f"push {k}", fontsize=LABEL)
        pose, finger = push.pose, push.end
    _caption(figure, task, plan)
    return figure


def _draw_push(axes: Axes, task: PushProblem, finger: Array, push: Push) -> None:
    axes.plot(*np.concatenate([finger[None], push.way]).T, color=PATH, lw=1, zorder=5)
    _draw_finger(axes, task, push.way[-1], face="white")
    _draw_finger(axes, task, push.end)
    draw_arrow(axes, push.way[-1], push.end - push.way[-1], FINGER_FORCE)


def _draw_finger(axes: Axes, task: PushProblem, place: Array, face: str = FINGER) -> None:
    """The disc in its true size; a point as a dot."""
    if task.finger.radius > 0:
        axes.add_patch(Circle(tuple(place), task.finger.radius, fc=face, ec=FINGER, lw=1.0, zorder=6))
    else:
        axes.plot(*place, "o", ms=4, mfc=face, mec=FINGER, zorder=6)


def _draw_scene(axes: Axes, task: PushProblem) -> None:
    """Workspace, obstacles and goal."""
    plain_axes(axes, *_view(task))
    low, high = task.bounds[:2], task.bounds[2:]
    if task.workspace is not None:
        axes.plot(
            *closed(np.array([low, [high[0], low[1]], high, [low[0], high[1]]])).T, color=EDGE, lw=1, zorder=1
        )
    for obstacle in task.obstacles:
        axes.fill(*obstacle.vertices.T, facecolor=WALL, ec="#8f959d", hatch=HATCH, lw=0, zorder=1)
        axes.plot(*closed(obstacle.vertices).T, color=EDGE, lw=1, zorder=2)
    axes.plot(*closed(task.outline(task.goal)).T, color=GOAL, lw=1.3, zorder=4)
    scale_bar(axes)


def _frames(task: PushProblem, plan: PushPlan) -> Iterator[Image8]:
    low, high = _view(task)
    figure = new_figure(4.6, min(4.6 * (high - low)[1] / (high - low)[0], 8.0) + 0.9)
    speed = max(plan.objective * RATE / FRAMES, SLOWEST) if plan.found else SLOWEST
    for moment in _moments(task, plan, speed / RATE):
        figure.clear()
        axes = figure.subplots()
        _draw_scene(axes, task)
        draw_object(axes, task.outline(moment.pose))
        _draw_finger(axes, task, moment.finger)
        faster = f"   ({speed:.2g} times faster)" if speed > SLOWEST else ""
        axes.set_title(f"t = {moment.time:.1f} s{faster}", fontsize=LABEL)
        _caption(figure, task, plan)
        yield pixels(figure)


def _moments(task: PushProblem, plan: PushPlan, dt: float) -> Iterator[Moment]:
    """Ways at the speed of travel, pushes at that of pushing, as the law of contact has it; then a while of rest."""
    under = support(task.limit_surface, task.shape, task.centroid)
    pose, finger, time = task.start, task.finger.start, 0.0
    for push in plan.pushes:
        way = np.concatenate([finger[None], push.way])
        gone = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))])
        for s in np.arange(0.0, gone[-1], dt * task.finger.travel_speed):
            place = np.array([np.interp(s, gone, way[:, d]) for d in (0, 1)])
            yield Moment(time=time + s / task.finger.travel_speed, pose=pose, finger=place)
        time += gone[-1] / task.finger.travel_speed
        moved = course(task, under, pose, push.way[-1], push.end, 0.02 * task.shape.size)
        length, poses = float(np.linalg.norm(push.end - push.way[-1])), np.array(moved.poses)
        for s in np.arange(0.0, length, dt * task.finger.push_speed):
            at = np.array([np.interp(s, moved.gone, poses[:, d]) for d in range(3)])
            place = push.way[-1] + s / length * (push.end - push.way[-1])
            yield Moment(time=time + s / task.finger.push_speed, pose=at, finger=place)
        time += length / task.finger.push_speed
        pose, finger = push.pose, push.end
    yield from [Moment(time=time, pose=pose, finger=finger)] * int(RATE)


def _view(task: PushProblem) -> tuple[Array, Array]:
    """The workspace with what stands about it, and room for the scale."""
    scene = [shapely.box(*task.bounds), *(shapely.Polygon(o.vertices) for o in task.obstacles)]
    low_x, low_y, high_x, high_y = shapely.total_bounds(scene)
    room = 0.02 * max(high_x - low_x, high_y - low_y)
    return room_below(np.array([low_x, low_y]) - room, np.array([high_x, high_y]) + room)


def _caption(figure: Figure, task: PushProblem, plan: PushPlan) -> None:
    """What is shown, above; what is what, below."""
    pushes = f", {len(plan.pushes)} pushes, {plan.objective:.3g} s" if plan.found else ""
    figure.suptitle(f"{plan.status.replace('_', ' ')}{pushes}", fontsize=CAPTION)
    names = ["object", "goal"] + ["wall"] * bool(task.obstacles) + ["finger"]
    legend(figure, *names, *(["finger path"] if plan.found else []))
