import numpy as np
import pytest
from scipy import ndimage

from dlm.infer.steadiness import camera_shift

SIZE = 120
NOBODY = np.zeros((SIZE, SIZE), dtype=bool)


def room(seed: int = 0) -> np.ndarray:
    """A wall with marks on it, and a floor."""
    rng = np.random.default_rng(seed)
    picture = np.full((SIZE, SIZE), 200.0)
    for _ in range(12):
        y, x = rng.integers(0, 90, 2)
        picture[y : y + 8, x : x + 12] = rng.uniform(60, 160)
    picture[100:] = 80
    return picture


def film(picture: np.ndarray, shifts: list[tuple[float, float]], noise: float = 0.0) -> np.ndarray:
    rng = np.random.default_rng(1)
    moved = [ndimage.shift(picture, s, order=1, mode="nearest") for s in [(0, 0), *shifts]]
    noisy = np.stack(moved) + rng.normal(0, noise, (len(moved), SIZE, SIZE))
    return np.repeat(np.clip(np.rint(noisy), 0, 255).astype(np.uint8)[..., None], 3, axis=-1)


@pytest.mark.parametrize("shift", [(1.0, 0.0), (0.5, -0.5), (-2.0, 2.5), (0.0, 3.0)])
def test_a_camera_that_shakes_is_measured(shift: tuple[float, float]) -> None:
    found = camera_shift(film(room(), [(0.0, 0.0), shift, (0.0, 0.0)], noise=3.0), NOBODY)
    assert found == pytest.approx(np.hypot(*shift), abs=0.2)


@pytest.mark.parametrize("noise", [0.0, 3.0, 10.0])
def test_a_camera_that_stands_still_does_so_in_noise(noise: float) -> None:
    assert camera_shift(film(room(), [(0.0, 0.0)] * 4, noise), NOBODY) == 0


def test_the_edge_of_the_floor_alone_shows_up_and_down() -> None:
    plain = np.full((SIZE, SIZE), 200.0)
    plain[100:] = 80
    assert camera_shift(film(plain, [(1.5, 0.0)]), NOBODY) == pytest.approx(1.5, abs=0.2)
    assert camera_shift(film(plain, [(0.0, 1.5)]), NOBODY) == 0  # nothing shows it


def test_what_moves_by_itself_is_no_camera() -> None:
    frames = film(room(), [(0.0, 0.0)] * 3)
    for t in range(4):
        frames[t, 40:60, 10 + 8 * t : 30 + 8 * t] = 20
    assert camera_shift(frames, NOBODY) == 0
    plain = film(np.full((SIZE, SIZE), 200.0), [(0.0, 0.0)] * 3)
    for t in range(4):
        plain[t, 40:60, 10 + 2 * t : 30 + 2 * t] = 20
    assert camera_shift(plain, NOBODY) == 0


def test_the_object_s_own_pixels_do_not_count() -> None:
    frames = film(np.full((SIZE, SIZE), 200.0), [(0.0, 0.0)] * 3)
    for t in range(4):
        frames[t, 5:115, 5 + 2 * t : 100 + 2 * t] = 20
    ours = np.zeros((SIZE, SIZE), dtype=bool)
    ours[2:118, 2:110] = True
    assert camera_shift(frames, ours) == 0


def test_large_pictures_are_measured_in_their_own_pixels() -> None:
    large = np.kron(room(), np.ones((4, 4)))
    frames = np.stack([large, np.roll(large, 6, axis=0)]).astype(np.uint8)
    found = camera_shift(np.repeat(frames[..., None], 3, axis=-1), np.zeros((480, 480), dtype=bool))
    assert found == pytest.approx(6, abs=0.5)
