"""Film strips and animations of contact trajectories, in the colours of the thesis's Fig. 3-6."""

import os
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes

from expert.drawing.canvas import (
    EDGE,
    FINGER,
    FINGER_FORCE,
    MOVING,
    OBJECT,
    REACTION,
    Image8,
    draw_arrow,
    draw_wall,
    new_figure,
    pixels,
    plain_axes,
    save_figure,
    save_frames,
    suffix,
)
from expert.errors import InvalidProblem
from expert.geometry.pose import Array, to_body, to_world
from expert.problems.contact import FREE, ContactTask, Plan

COLUMNS = 5
FRAMES_PER_STEP, RATE = 6, 12.0
"""An animation shows a step in half a second, whatever dt is: slow enough to follow contacts."""


@dataclass(frozen=True, kw_only=True)
class Moment:
    """What one picture shows: a pose, and fingers (C, 2) with forces; fingers in contact are filled."""

    pose: Array
    fingers: Array
    touching: Array
    arrows: tuple[tuple[Array, Array, str], ...]
    """(where it acts, its arrow [m], colour)."""


def draw(task: ContactTask, plan: Plan | None, path: str | os.PathLike[str]) -> None:
    """Write a film strip (.png, .svg, .pdf: one panel per step) or an animation (.gif, .mp4).

    An answer without a plan shows the desired motion alone.  Raises InvalidProblem for any other suffix, and without answer.
    """
    if plan is None:
        raise InvalidProblem(
            "solution", expected="a solution file", got="a problem file", remedy="solve it first"
        )
    if suffix(path) in MOVING:
        save_frames(_frames(task, plan), path, rate=RATE)
    else:
        _film_strip(task, plan, path)


def _film_strip(task: ContactTask, plan: Plan, path: str | os.PathLike[str]) -> None:
    low, high = _view(task, plan)
    columns, rows = min(task.steps, COLUMNS), -(-task.steps // COLUMNS)
    width, height = 2.4, 2.4 * (high - low)[1] / (high - low)[0]
    figure = new_figure(columns * width, rows * (height + 0.25) + 0.4)
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for t, axes in enumerate(panels):
        if t >= task.steps:
            axes.set_axis_off()
            continue
        plain_axes(axes, low, high)
        _draw_moment(axes, task, _moment(task, plan, t))
        axes.set_title(f"t = {t * task.trajectory.dt:g} s", fontsize=8)
    figure.suptitle(_title(task, plan), fontsize=9)
    save_figure(figure, path)


def _frames(task: ContactTask, plan: Plan) -> Iterator[Image8]:
    low, high = _view(task, plan)
    figure = new_figure(4.0, min(4.0 * (high - low)[1] / (high - low)[0] + 0.5, 8.0))
    for moment in _motion(task, plan):
        figure.clear()
        axes = figure.subplots()
        plain_axes(axes, low, high)
        _draw_moment(axes, task, moment)
        figure.suptitle(_title(task, plan), fontsize=9)
        yield pixels(figure)


def _moment(task: ContactTask, plan: Plan, t: int) -> Moment:
    """The situation at knot t."""
    if not plan.found:
        none = np.empty((0, 2))
        return Moment(pose=task.trajectory.poses[t], fingers=none, touching=np.empty(0), arrows=())
    scale = _metres_per_newton(task, plan)
    pushes = zip(plan.positions[t], plan.forces[t], strict=True)
    fingers = [(point, scale * force, FINGER_FORCE) for point, force in pushes]
    reactions = [(c.point, scale * c.force, REACTION) for c in plan.contact_forces if c.step == t]
    return Moment(
        pose=task.trajectory.poses[t],
        fingers=plan.positions[t],
        touching=plan.modes[t] != FREE,
        arrows=(*fingers, *reactions),
    )


def _motion(task: ContactTask, plan: Plan) -> Iterator[Moment]:
    """Knots and what lies between them: poses on straight lines, fingers that stick kept at their body points."""
    for t in range(task.steps - 1):
        here, there = _moment(task, plan, t), _moment(task, plan, t + 1)
        sticks = here.touching * there.touching
        for s in np.arange(FRAMES_PER_STEP) / FRAMES_PER_STEP:
            pose = (1 - s) * here.pose + s * there.pose
            carried = to_world(pose, to_body(here.pose, here.fingers))
            moved = (1 - s) * here.fingers + s * there.fingers
            fingers = np.where(np.reshape(sticks, (-1, 1)), carried, moved)
            arrows = tuple(
                (to_world(pose, to_body(here.pose, p[None]))[0], f, color) for p, f, color in here.arrows
            )
            yield Moment(pose=pose, fingers=fingers, touching=here.touching, arrows=arrows)
    last = _moment(task, plan, task.steps - 1)
    yield from [last] * FRAMES_PER_STEP


def _draw_moment(axes: Axes, task: ContactTask, moment: Moment) -> None:
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    for wall in task.environment.walls:
        draw_wall(axes, wall, 4 * (right - left + top - bottom))
    goal = to_world(task.trajectory.poses[-1], task.body.vertices)
    axes.fill(*goal.T, facecolor="none", edgecolor=EDGE, lw=0.7, ls=":", zorder=2)
    axes.fill(
        *to_world(moment.pose, task.body.vertices).T, facecolor=OBJECT, edgecolor=EDGE, lw=1.2, zorder=3
    )
    for point, arrow, color in moment.arrows:
        # Finger forces push: their arrows end at the contact; reactions begin there.
        draw_arrow(axes, point - arrow if color == FINGER_FORCE else point, arrow, color)
    for place, touches in zip(moment.fingers, moment.touching, strict=True):
        face = FINGER if touches else "white"
        axes.plot(*place, "o", ms=5.5, mfc=face, mec=FINGER, mew=1.2, zorder=6)


def _metres_per_newton(task: ContactTask, plan: Plan) -> float:
    """The largest force is drawn 0.6 L long."""
    largest = max(
        [
            np.linalg.norm(plan.forces, axis=-1).max(initial=0.0),
            *(np.linalg.norm(c.force) for c in plan.contact_forces),
        ]
    )
    return 0.6 * task.body.size / max(float(largest), 1e-12)


def _view(task: ContactTask, plan: Plan) -> tuple[Array, Array]:
    """Box that shows the object at all poses, fingers and arrows, with a little room."""
    shown = [to_world(task.trajectory.poses, task.body.vertices).reshape(-1, 2)]
    if plan.found:
        shown += [plan.positions.reshape(-1, 2)]
        scale = _metres_per_newton(task, plan)
        shown += [(plan.positions - scale * plan.forces).reshape(-1, 2)]
        shown += [c.point[None] + scale * c.force for c in plan.contact_forces]
    points = np.concatenate(shown)
    room = 0.15 * task.body.size
    low, high = points.min(axis=0) - room, points.max(axis=0) + room
    # Neither axis may become a sliver.
    short = np.maximum(0.5 * (high - low).max() - (high - low), 0.0)
    return low - short / 2, high + short / 2


def _title(task: ContactTask, plan: Plan) -> str:
    plane = f"{task.environment.plane} plane, {task.fingers.count} finger" + "s" * (task.fingers.count > 1)
    if not plan.found:
        return f"{plane}: {plan.status}"
    largest = 0.6 * task.body.size / _metres_per_newton(task, plan)
    return f"{plane}: cost {plan.objective:.4g}; longest arrow {largest:.2g} N"
