import numpy as np

from datasets.render import render
from dlm.perception import perceive
from tests.support.videos import LEANING, PATH, errors


def test_turns_may_be_large_and_angles_run_on() -> None:
    poses = PATH.copy()
    poses[:, 2] = [0, 1.5, 3.0, 4.5, 6.0]
    seen = perceive(render(LEANING, poses))
    angle, position, outline = errors(seen, LEANING, poses)
    assert angle < 0.5
    assert position < 0.15
    assert outline < 0.3


def test_a_square_turns_the_shorter_way() -> None:
    square = 0.025 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    seen = perceive(render(square, PATH))
    assert errors(seen, square, PATH)[0] < 0.5
