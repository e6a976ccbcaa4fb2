"""Film strips and animations of contact trajectories, in the colours of the thesis's Fig. 3-6."""

import os
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

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
    FINGER_FORCE,
    LABEL,
    REACTION,
    closed,
    draw_arrow,
    draw_fingers,
    draw_half_plane,
    draw_object,
    force_scale,
    legend,
    scale_bar,
)
from expert.errors import InvalidProblem
from expert.geometry.pose import Array, to_body, to_world
from expert.problems.contact import FREE, ContactTask, Plan

COLUMNS = 5
FRAMES_PER_STEP, RATE = 6, 12.0
"""An animation shows a step in half a second, whatever dt is: slow enough to follow contacts."""
LONGEST = 0.6
"""Length of the largest force over the object's size."""


@dataclass(frozen=True, kw_only=True)
class Moment:
    """What one picture shows: time [s], pose, fingers (C, 2) of which some touch, and forces."""

    time: float
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
        save_figure(film_strip(task, plan), path)


def film_strip(task: ContactTask, plan: Plan) -> Figure:
    """One panel per step."""
    low, high = _view(task, plan)
    columns, rows = min(task.steps, COLUMNS), -(-task.steps // COLUMNS)
    height = 2.4 * (high - low)[1] / (high - low)[0]
    figure = new_figure(columns * 2.4, rows * (height + 0.25) + 0.7)
    for t, axes in enumerate(figure.subplots(rows, columns, squeeze=False).ravel()):
        if t >= task.steps:
            axes.set_axis_off()
            continue
        _draw_moment(axes, task, plan, _moment(task, plan, t))
        axes.set_title(f"t = {t * task.trajectory.dt:.3g} s", fontsize=LABEL)
    _caption(figure, task, plan)
    return figure


def _frames(task: ContactTask, plan: Plan) -> Iterator[Image8]:
    low, high = _view(task, plan)
    figure = new_figure(4.4, min(4.4 * (high - low)[1] / (high - low)[0], 8.0) + 1.0)
    slower = FRAMES_PER_STEP / RATE / task.trajectory.dt
    for moment in _motion(task, plan):
        figure.clear()
        axes = figure.subplots()
        _draw_moment(axes, task, plan, moment)
        axes.set_title(f"t = {moment.time:.2f} s   ({slower:.3g} times slower)", fontsize=LABEL)
        _caption(figure, task, plan)
        yield pixels(figure)


def _moment(task: ContactTask, plan: Plan, t: int) -> Moment:
    """The situation at knot t."""
    time, pose = t * task.trajectory.dt, task.trajectory.poses[t]
    if not plan.found:
        none = np.empty((0, 2))
        return Moment(time=time, pose=pose, fingers=none, touching=np.empty(0, dtype=bool), arrows=())
    scale = _metres_per_newton(task, plan)
    pushes = zip(plan.positions[t], plan.forces[t], strict=True)
    fingers = [(point, scale * force, FINGER_FORCE) for point, force in pushes]
    reactions = [(c.point, scale * c.force, REACTION) for c in plan.contact_forces if c.step == t]
    touching = plan.modes[t] != FREE
    return Moment(
        time=time, pose=pose, fingers=plan.positions[t], touching=touching, arrows=(*fingers, *reactions)
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
            arrows = tuple((to_world(pose, to_body(here.pose, p[None]))[0], f, c) for p, f, c in here.arrows)
            yield Moment(
                time=here.time + s * task.trajectory.dt,
                pose=pose,
                fingers=np.where(np.reshape(sticks, (-1, 1)), carried, moved),
                touching=here.touching,
                arrows=arrows,
            )
    last = _moment(task, plan, task.steps - 1)
    yield from [last] * FRAMES_PER_STEP


def _draw_moment(axes: Axes, task: ContactTask, plan: Plan, moment: Moment) -> None:
    plain_axes(axes, *_view(task, plan))
    for wall in task.environment.walls:
        draw_half_plane(axes, wall)
    goal = to_world(task.trajectory.poses[-1], task.body.vertices)
    axes.plot(*closed(goal).T, color=EDGE, lw=0.7, ls=":", zorder=4)
    draw_object(axes, to_world(moment.pose, task.body.vertices))
    for point, arrow, colour in moment.arrows:
        # Finger forces push: their arrows end at the contact; reactions begin there.
        draw_arrow(axes, point - arrow if colour == FINGER_FORCE else point, arrow, colour)
    draw_fingers(axes, moment.fingers, around=moment.pose[:2], hollow=np.logical_not(moment.touching))
    scale_bar(axes)
    if plan.found:
        force_scale(axes, _metres_per_newton(task, plan))


def _metres_per_newton(task: ContactTask, plan: Plan) -> float:
    """The largest force is drawn LONGEST of the object's size."""
    reactions = [float(np.linalg.norm(c.force)) for c in plan.contact_forces]
    largest = max([np.linalg.norm(plan.forces, axis=-1).max(initial=0.0), *reactions])
    return LONGEST * task.body.size / max(float(largest), 1e-12)


def _view(task: ContactTask, plan: Plan) -> tuple[Array, Array]:
    """Box that shows the object at all poses, fingers and arrows, with a little room, and room for scales below."""
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
    return room_below(low - short / 2, high + short / 2)


def _caption(figure: Figure, task: ContactTask, plan: Plan) -> None:
    """What is shown, above; what is what, below."""
    count = task.fingers.count
    what = f"{task.environment.plane} plane, {count} finger" + "s" * (count > 1)
    cost = f", cost {plan.objective:.4g}" if plan.found else ""
    figure.suptitle(f"{what}: {plan.status.replace('_', ' ')}{cost}", fontsize=CAPTION)
    names = ["object", "last pose"] + ["wall"] * bool(task.environment.walls)
    if plan.found:
        names += ["finger"] + ["finger without contact"] * bool((plan.modes == FREE).any())
        names += ["force of a finger"] + ["reaction"] * bool(plan.contact_forces)
    legend(figure, *names)
