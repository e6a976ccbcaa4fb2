import numpy as np
import pytest

from datasets.disturb import random_palette
from datasets.render import render
from dlm.perception import perceive
from tests.support.videos import errors, task_of


@pytest.mark.parametrize("seed", range(4))
def test_colours_may_be_any_that_differ(seed: int) -> None:
    task = task_of("slide_lift", seed=1)
    palette = random_palette(np.random.default_rng(seed))
    seen = perceive(render(task.body.vertices, task.trajectory.poses, palette=palette))
    angle, position, _ = errors(seen, task.body.vertices, task.trajectory.poses)
    assert angle < 0.4
    assert position < 0.15
