import cv2
import numpy as np
import pytest

from datasets.disturb import random_palette
from datasets.render import Camera, Frames, render
from dlm.perception import perceive
from dlm.perception.appearance import _around, _standing, separate
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


def hues_of_half_size(frames: Frames) -> Frames:
    """What compression does to colours, and nothing else of it."""
    coded = []
    for frame in frames:
        brightness, *hues = cv2.split(cv2.cvtColor(frame, cv2.COLOR_RGB2YCrCb))
        size = brightness.shape[::-1]
        coarse = [
            cv2.resize(cv2.resize(h, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA), size) for h in hues
        ]
        coded.append(cv2.cvtColor(cv2.merge([brightness, *coarse]), cv2.COLOR_YCrCb2RGB))
    return np.stack(coded)


@pytest.mark.parametrize("seed", range(6))
def test_coarse_hues_are_no_things_but_a_dark_finger_is_one(seed: int) -> None:
    task = task_of("slide_lift", seed=seed)
    camera = Camera(size=50, scale=4e-3)
    frames = render(task.body.vertices, task.trajectory.poses, camera)
    plain, coarse = (separate(f, camera, floor=True).foreign for f in (frames, hues_of_half_size(frames)))
    assert coarse.mean() < plain.mean() + 0.02  # a ring of two pixels around the object is .08 of the picture
    hand = frames.copy()
    for t in range(len(hand)):
        hand[t, 5:8, 20 + 4 * t : 23 + 4 * t] = 40
    hidden = separate(hues_of_half_size(hand), camera, floor=True).foreign[:, ::-1]  # rows from the top
    for t in range(len(hand)):
        assert hidden[t, 4:9, 19 + 4 * t : 24 + 4 * t].all()


def test_a_piece_counts_as_a_whole_but_not_through_time() -> None:
    masks = np.zeros((2, 12, 12), dtype=bool)
    masks[0, 2, 2:7] = masks[0, 6:9, 6:8] = masks[1, 2, 2:7] = True
    cores = np.zeros_like(masks)
    cores[0, 2, 3] = cores[1, 11, 11] = True
    kept = _around(cores, masks)
    assert kept[0, 2, 2:7].all()
    assert kept.sum() == 5
