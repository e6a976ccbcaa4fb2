"""What all pictures are made of, in one style: objects, numbered fingers, walls, forces, scales and legends."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.legend_handler import HandlerTuple
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke

from expert.geometry.pose import Array, cross, perpendicular, rotation
from expert.world.walls import HalfPlane

OBJECT, EDGE, WALL = "#d9d2c5", "#4a4338", "#b8bcc2"
FINGER, FINGER_FORCE, REACTION = "#c8102e", "#1a8a3c", "#1f5fbf"
"""Red fingers, green finger forces, blue reactions, as in the thesis's Fig. 3-6."""
START, GOAL, PATH = "#8d8678", "#7a3db8", "#1f5fbf"
"""Grey starts, purple goal, blue paths, as in the thesis's Fig. 5-28."""
FREE, ELSEWHERE, ORIGIN = "#2b7fd0", "#d3e6f7", "#111111"
"""Of configuration space: the part around the start, other bounded parts, the start and curves around it."""
FINGERS = (FINGER, "#1a8a3c", "#7a4fb5", "#d9822b", "#0e8c9c", "#b5527a", "#6b6b2f")
"""One colour each, where pictures tell fingers apart."""
CAPTION, LABEL, NUMBER = 9, 8, 7
"""Sizes of type [points]."""
HATCH = "////"
BESIDE = rotation(np.radians(65))
HALO = (withStroke(linewidth=1.8, foreground="white"),)


def finger_colour(k: int) -> str:
    """The colour of finger k."""
    return FINGERS[k % len(FINGERS)]


def closed(points: Array) -> Array:
    """Corners (k, 2) of a polygon with the first one repeated."""
    return np.concatenate([points, points[:1]])


def draw_object(axes: Axes, outline: Array, pieces: Iterable[Array] = ()) -> None:
    """The object's corners (V, 2), its convex pieces faintly outlined."""
    axes.fill(*outline.T, color=OBJECT, lw=0, zorder=2)
    for piece in pieces:
        axes.fill(*piece.T, color=OBJECT, ec="#c6bdae", lw=0.6, zorder=2)
    axes.plot(*closed(outline).T, color=EDGE, lw=1.2, zorder=3)


def draw_fingers(
    axes: Axes,
    places: Array,
    *,
    around: Array,
    hollow: Sequence[bool] | np.ndarray = (),
    colours: Sequence[str] = (FINGER,),
    style: str = "o",
    first: int = 0,
) -> None:
    """Fingers (N, 2) with their numbers beside them, not between them and a point (2,) of the object; hollow: without contact."""
    for k, place in enumerate(places):
        colour = colours[k % len(colours)]
        face = "white" if k < len(hollow) and hollow[k] else colour
        axes.plot(*place, style, ms=6, mfc=face, mec=colour, mew=1.2, zorder=6)
        away = BESIDE @ (place - around)  # off the normal, along which forces act
        length = float(np.linalg.norm(away))
        shift = 10 * away / length if length > 0 else np.array([7.0, 7.0])
        axes.annotate(
            f"{first + k}",
            tuple(place),
            xytext=tuple(shift),
            textcoords="offset points",
            ha="center",
            va="center",
            fontsize=NUMBER,
            color=colour,
            path_effects=HALO,
            zorder=8,
            annotation_clip=True,
        )


def draw_half_plane(axes: Axes, wall: HalfPlane) -> None:
    """The solid side of a half-plane, as far as the picture reaches, with its surface as a line."""
    low, high = np.transpose([axes.get_xlim(), axes.get_ylim()])
    reach = 4 * float(np.abs([low - wall.point, high - wall.point]).max())
    along = reach * perpendicular(wall.normal)
    ends = np.stack([wall.point - along, wall.point + along])
    axes.fill(*np.concatenate([ends, ends[::-1] - reach * wall.normal]).T, color=WALL, lw=0, zorder=0)
    axes.plot(*ends.T, color=EDGE, lw=1, zorder=1)


def draw_segment(axes: Axes, ends: Array, outline: Array) -> None:
    """A wall without thickness (2, 2): a line, with a grey band on the side that faces away from the object."""
    along = ends[1] - ends[0]
    away = np.array([along[1], -along[0]]) / np.linalg.norm(along)
    if np.median(cross(along, outline - ends[0])) < 0:
        away = -away
    depth = 0.05 * float(np.ptp(outline, axis=0).max())
    band = np.concatenate([ends, ends[::-1] + depth * away])
    axes.fill(*band.T, facecolor=WALL, ec="#8f959d", hatch=HATCH, lw=0, zorder=1)
    axes.plot(*ends.T, color=EDGE, lw=1.4, zorder=3)


def draw_arrow(axes: Axes, tail: Array, arrow: Array, colour: str) -> None:
    """An arrow of constant width from `tail` along `arrow` [m]; a very short one is left out."""
    if np.linalg.norm(arrow) > 1e-6 * abs(np.diff(axes.get_xlim())[0]):
        style = {
            "arrowstyle": "-|>",
            "color": colour,
            "lw": 1.5,
            "shrinkA": 0,
            "shrinkB": 0,
            "mutation_scale": 8,
        }
        axes.annotate("", xy=tuple(tail + arrow), xytext=tuple(tail), arrowprops=style, zorder=5)


def scale_bar(axes: Axes) -> None:
    """A bar of a round length, about a quarter of the picture wide, in its lower left corner."""
    left, width, y = _bottom_line(axes)
    length = round_down(0.28 * width)
    ends = (left + 0.04 * width, left + 0.04 * width + length)
    axes.plot(ends, (y, y), color=EDGE, lw=2.5, solid_capstyle="butt", zorder=8)
    _over(axes, ends[0], y + 0.02 * width, f"{1e3 * length:g} mm", "left")


def force_scale(axes: Axes, metres_per_newton: float) -> None:
    """An arrow of a round force, as long as such a force is drawn, in the lower right corner."""
    left, width, y = _bottom_line(axes)
    force = round_down(0.3 * width / metres_per_newton)
    length = force * metres_per_newton
    tail = np.array([left + 0.96 * width - length, y])
    draw_arrow(axes, tail, np.array([length, 0.0]), EDGE)
    _over(axes, tail[0] + length, y + 0.025 * width, f"{force:g} N", "right")


def round_down(value: float) -> float:
    """The largest of 1, 2 and 5 times a power of ten that is not above a positive value."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(power * max(digit for digit in (1, 2, 5) if digit * power <= value * (1 + 1e-9)))


def _bottom_line(axes: Axes) -> tuple[float, float, float]:
    """Left end, width, and height of the line on which scales stand."""
    (left, right), bottom = axes.get_xlim(), axes.get_ylim()[0]
    return left, right - left, bottom + 0.035 * (right - left)


def _over(axes: Axes, x: float, y: float, text: str, side: str) -> None:
    axes.text(x, y, text, ha=side, fontsize=NUMBER, color=EDGE, path_effects=HALO, zorder=8)


def _line(colour: str, **style: Any) -> Line2D:
    return Line2D([], [], color=colour, **style)


def _dot(face: str, edge: str, marker: str = "o") -> Line2D:
    return Line2D([], [], ls="", marker=marker, ms=6, mfc=face, mec=edge, mew=1.2)


ENTRIES: dict[str, Callable[[], Any]] = {
    "object": lambda: Patch(facecolor=OBJECT, edgecolor=EDGE),
    "wall": lambda: Patch(facecolor=WALL, edgecolor=EDGE),
    "finger": lambda: _dot(FINGER, FINGER),
    "finger without contact": lambda: _dot("white", FINGER),
    "finger, one colour each": lambda: tuple(_dot(colour, colour) for colour in FINGERS[:3]),
    "fixed finger": lambda: _dot(EDGE, EDGE, "s"),
    "finger at the start": lambda: _dot("white", FINGER),
    "finger at the end": lambda: _dot(FINGER, FINGER),
    "finger path": lambda: _line(PATH, lw=1),
    "force of a finger": lambda: _line(FINGER_FORCE, lw=1.5, marker=">", ms=4, markevery=(1, 1)),
    "reaction": lambda: _line(REACTION, lw=1.5, marker=">", ms=4, markevery=(1, 1)),
    "last pose": lambda: _line(EDGE, lw=0.7, ls=":"),
    "gripper": lambda: _line(EDGE, lw=1.2, ls=(0, (4, 2))),
    "way out": lambda: _line(PATH, lw=0.9),
    "obstacle of a finger": lambda: tuple(Patch(color=colour, alpha=0.28) for colour in FINGERS[:3]),
    "free around the start": lambda: Patch(color=FREE),
    "free elsewhere": lambda: Patch(facecolor=ELSEWHERE, edgecolor=FREE),
    "closed curve in obstacles": lambda: _line(ORIGIN, lw=1.3, ls=(0, (3, 2))),
    "start": lambda: _line(ORIGIN, ls="", marker="+", ms=8, mew=1.4),
    "starts": lambda: _line(START, lw=0.7),
    "executions": lambda: Patch(facecolor=OBJECT, edgecolor=EDGE, alpha=0.7),
    "goal": lambda: _line(GOAL, lw=1.3),
    "free at each knot": lambda: Patch(facecolor=(*to_rgb(PATH), 0.25), edgecolor=PATH),
    "limits of the cages": lambda: Patch(color=(*to_rgb(PATH), 0.15)),
    "set of starts": lambda: Patch(color=PATH),
}
"""What legends may name, and how it looks there."""


def legend(figure: Figure, *names: str, **further: object) -> None:
    """One line below the panels that says what is what: entries by name, and further ones with their own sample."""
    samples = {name: ENTRIES[name]() for name in names} | further
    figure.legend(
        list(samples.values()),
        [label.replace("_", " ") for label in samples],
        loc="outside lower center",
        ncols=max(1, min(len(samples), int(figure.get_figwidth() / 1.3))),
        frameon=False,
        fontsize=LABEL,
        handlelength=1.6,
        columnspacing=1.4,
        handletextpad=0.5,
        handler_map={tuple: HandlerTuple(ndivide=None, pad=0.1)},
    )
