import numpy as np
import pytest

from dlm.perception.background import background_of
from expert.geometry.pose import Array

WALL, GROUND = np.array([200.0, 190.0, 180.0]), np.array([60.0, 80.0, 100.0])
SIZE = 48


def scene(slope: float, deviation: float) -> tuple[Array, Array, Array]:
    """Images (T, h, w, 3) of wall and ground under light that changes across them, the ground's share, and the light."""
    ground = np.zeros((SIZE, SIZE))
    ground[:10], ground[10] = 1.0, 0.3
    light = np.exp(slope * np.linspace(-1, 1, SIZE))[None] * np.ones((SIZE, 1))
    plain = WALL + ground[..., None] * (GROUND - WALL)
    noise = np.random.default_rng(0).normal(0, deviation, (3, SIZE, SIZE, 3))
    images = light[..., None] * plain + noise
    images[:, 20:30, 15:28] = [20, 160, 30]  # something else
    return images, ground, light


@pytest.mark.parametrize("slope", [0.0, 0.2])
def test_colours_light_and_noise_are_found_behind_an_object(slope: float) -> None:
    images, ground, light = scene(slope, deviation=2.0)
    found = background_of(images, ground)
    empty = found.light[..., None] * found.image
    truth = light[..., None] * (WALL + ground[..., None] * (GROUND - WALL))
    assert np.abs(empty - truth).max() < 3
    assert found.noise == pytest.approx(2.0, rel=0.15)
    hue = found.wall / found.wall.sum()
    np.testing.assert_allclose(hue, WALL / WALL.sum(), atol=2e-3)


def test_without_ground_there_is_only_a_wall() -> None:
    images, _, _ = scene(0.0, deviation=0.0)
    images[:, :11] = WALL
    found = background_of(images, np.zeros((SIZE, SIZE)))
    np.testing.assert_allclose(found.image, np.broadcast_to(WALL, found.image.shape), atol=0.5)
