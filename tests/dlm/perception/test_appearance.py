import numpy as np
import pytest

from datasets.disturb import random_palette
from datasets.render import render
from dlm.perception import perceive
from dlm.perception.appearance import _standing, _things
from tests.support.videos import errors, task_of


@pytest.mark.parametrize("seed", range(4))
def test_colours_may_be_any_that_differ(seed: int) -> None:
    task = task_of("slide_lift", seed=1)
    palette = random_palette(np.random.default_rng(seed))
    seen = perceive(render(task.body.vertices, task.trajectory.poses, palette=palette))
    angle, position, _ = errors(seen, task.body.vertices, task.trajectory.poses)
    assert angle < 0.4
    assert position < 0.15


def moving_box(size: int = 50) -> np.ndarray:
    """Shares of an object that moves over the picture (T, h, w) by two pixels a frame."""
    share = np.zeros((4, size, size))
    for t in range(4):
        share[t, 20:30, 5 + 2 * t : 18 + 2 * t] = 1
    return share


def test_what_stands_still_is_told_from_what_moves() -> None:
    share = moving_box()
    share[:, 35:40, 30:45] = 1
    still = _standing(share)
    assert still[:, 35:40, 30:45].all()
    assert not still[:, 15:32].any()


def test_where_nothing_moves_everything_may_be_the_object() -> None:
    share = np.repeat(moving_box()[:1], 3, axis=0)
    assert not _standing(share).any()


def test_a_few_odd_pixels_are_no_thing() -> None:
    masks = np.zeros((2, 12, 12), dtype=bool)
    masks[0, 2, 2:7] = True  # five
    masks[0, 6:9, 6:8] = True  # six
    masks[1, 2:4, 2:5] = True  # six, next to the five of the frame before
    kept = _things(masks)
    assert not kept[0, 2].any()
    assert kept[0, 6:9, 6:8].all()
    assert kept[1].sum() == 6
