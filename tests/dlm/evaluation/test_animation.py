import base64
import io
import re

import numpy as np
from PIL import Image

from dlm.evaluation.animation import animate, input_film
from dlm.execution import expert_action, idle_action
from dlm.simulator import SimulatorSettings
from dlm.tasks import TaskBatch

RIGID = SimulatorSettings()


def polygons(film: str) -> list[np.ndarray]:
    """Corners (key frames, n, 2) [px] of every polygon of a film: the object, then its goal."""
    rows = re.findall(r'attributeName="points" values="([^"]+)"', film)
    return [
        np.array([[[float(x) for x in p.split(",")] for p in f.split()] for f in r.split(";")]) for r in rows
    ]


def test_the_expert_s_object_follows_its_goal_and_an_untouched_one_stays(tasks: TaskBatch) -> None:
    thing, goal = polygons(animate(tasks, 0, expert_action(tasks), RIGID))
    assert np.abs(goal[-1] - goal[0]).max() > 5  # pixels
    assert np.abs(thing - goal).max() < 3
    untouched, goal = polygons(animate(tasks, 0, idle_action(tasks), RIGID))
    assert np.abs(untouched - untouched[0]).max() < 1
    assert np.abs(untouched[-1] - goal[-1]).max() > 5


def test_a_film_has_a_dot_for_each_finger_and_key_times_for_each_frame(tasks: TaskBatch) -> None:
    film = animate(tasks, 0, expert_action(tasks), RIGID)
    assert film.count("<circle") == 2
    times = re.findall(r'keyTimes="([^"]+)"', film)
    values = re.findall(r'values="([^"]+)"', film)
    assert {len(t.split(";")) for t in times} == {len(v.split(";")) for v in values}
    assert "nan" not in film


def test_the_input_film_shows_every_frame(tasks: TaskBatch) -> None:
    data = re.search(r"base64,([^\"]+)", input_film(tasks, 0))
    assert data is not None
    with Image.open(io.BytesIO(base64.b64decode(data[1]))) as film:
        assert film.n_frames == 5
        film.seek(4)
        last = np.array(film.convert("RGB")).astype(int)
    assert np.abs(last - tasks.video[0, 4].numpy()).mean() < 3  # a palette of 256 colours
