import numpy as np

from datasets.render import Camera, Palette, render
from dlm.perception import perceive
from expert.geometry.pose import to_world
from tests.support.videos import LEANING, PATH


def test_an_object_that_changes_its_shape_is_a_poor_fit() -> None:
    video = render(LEANING, PATH)
    video[3:] = render(LEANING * [1.0, 0.6], PATH[3:])
    seen = perceive(video)
    assert seen.status == "poor_fit"
    assert "grey levels" in seen.reason
    assert np.isfinite(seen.vertices).all()
    assert np.isfinite(seen.poses).all()


def test_something_that_grows_out_of_the_object_is_a_poor_fit() -> None:
    """Of its very colour, in one frame only: no part of the outline, and too much for the camera's noise."""
    video = render(LEANING, PATH)
    (column, row) = Camera().to_pixels(to_world(PATH[2], LEANING)[2]).round().astype(int)
    video[2, row - 1 : row + 2, column + 1 : column + 5] = Palette().object
    seen = perceive(video)
    assert seen.status == "poor_fit"
    assert "no part of its outline" in seen.reason
    clean = perceive(render(LEANING, PATH))
    assert np.abs(seen.poses - clean.poses).max() < 0.02
