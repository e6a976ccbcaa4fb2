"""Executed actions as small animated SVG pictures that a browser plays without scripts."""

import base64
import io

import numpy as np
from PIL import Image

from dlm.inverse_dynamics.layer import Action
from dlm.simulator import SimulatorSettings
from dlm.simulator.replay import Replay, replay
from dlm.tasks import TaskBatch
from expert.geometry.pose import Array, to_world

WIDTH = 155
"""Of a picture [px]."""
MARGIN, BELOW = 0.04, 0.015
"""Seen beyond the desired motion, and below the floor [m]."""
SECONDS = 3.0
"""One round of the animation, with a rest at its end; several times slower than the motion."""
STRIDE = 4
"""Substeps from one key frame to the next."""
FINGER_COLOURS = ("#d62728", "#1f77b4", "#9467bd", "#2ca02c")


def input_film(tasks: TaskBatch, k: int) -> str:
    """The video of task k as an image that plays itself."""
    frames = [Image.fromarray(frame) for frame in tasks.video[k].numpy()]
    pause = round(750 * SECONDS / (len(frames) - 1))
    rest = round(1000 * SECONDS) - pause * (len(frames) - 1)
    out = io.BytesIO()
    durations = [*[pause] * (len(frames) - 1), rest]
    frames[0].save(out, format="GIF", save_all=True, append_images=frames[1:], duration=durations, loop=0)
    data = base64.b64encode(out.getvalue()).decode()
    return f'<img class="video" width="{WIDTH}" alt="input video" src="data:image/gif;base64,{data}">'


def animate(tasks: TaskBatch, k: int, action: Action, simulator: SimulatorSettings) -> str:
    """SVG of task k: desired outline (dashed), simulated object and fingers."""
    task = tasks.samples[k].task
    film = replay(task, action.positions[k].detach().numpy(), action.forces[k].detach().numpy(), simulator)
    return _svg(film, task.body.vertices)


def _svg(film: Replay, vertices: Array) -> str:
    frames = np.arange(0, len(film.substep_poses), STRIDE)
    goal = to_world(film.desired[frames], vertices)
    low, high = goal.min((0, 1)) - MARGIN, goal.max((0, 1)) + MARGIN
    scale = WIDTH / (high[0] - low[0])
    height = round((high[1] + BELOW) * scale)

    def pixels(points: Array) -> Array:
        x, y = np.moveaxis(np.asarray(points), -1, 0)
        return np.stack([(x - low[0]) * scale, (high[1] - y) * scale], -1)

    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{height}" viewBox="0 0 {WIDTH} {height}">',
        f'<rect y="{high[1] * scale:.1f}" width="{WIDTH}" height="{BELOW * scale:.1f}" class="film-floor"/>',
        _polygon(
            pixels(to_world(film.substep_poses[frames], vertices)),
            'class="film-object" stroke-width="1"',
        ),
        _polygon(pixels(goal), 'class="film-goal" stroke-width="1.2" stroke-dasharray="4 3"'),
        *(
            _dot(pixels(film.fingers[frames, c]), FINGER_COLOURS[c % len(FINGER_COLOURS)])
            for c in range(film.fingers.shape[1])
        ),
        "</svg>",
    ]
    return "".join(parts)


def _timing(count: int) -> str:
    """Key times that leave a quarter of the round for a rest at the end."""
    times = [*np.linspace(0, 0.75, count), 1.0]
    keys = ";".join(f"{t:.4f}" for t in times)
    return f'dur="{SECONDS}s" repeatCount="indefinite" keyTimes="{keys}"'


def _polygon(corners: Array, style: str) -> str:
    """Corners (frames, n, 2)."""
    rows = [" ".join(f"{x:.1f},{y:.1f}" for x, y in frame) for frame in corners]
    values = ";".join([*rows, rows[-1]])
    return f'<polygon points="{rows[0]}" {style}><animate attributeName="points" values="{values}" {_timing(len(rows))}/></polygon>'


def _dot(centres: Array, colour: str) -> str:
    """Centres (frames, 2)."""
    moves = ""
    for name, column in zip(("cx", "cy"), centres.T, strict=True):
        values = ";".join(f"{v:.1f}" for v in [*column, column[-1]])
        moves += f'<animate attributeName="{name}" values="{values}" {_timing(len(centres))}/>'
    return (
        f'<circle cx="{centres[0, 0]:.1f}" cy="{centres[0, 1]:.1f}" r="3.5" fill="{colour}">{moves}</circle>'
    )
