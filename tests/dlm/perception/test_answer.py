import numpy as np

from datasets.render import render
from dlm.perception import perceive
from tests.support.videos import LEANING, PATH


def test_an_object_that_changes_its_shape_is_a_poor_fit() -> None:
    video = render(LEANING, PATH)
    video[3:] = render(LEANING * [1.0, 0.6], PATH[3:])
    seen = perceive(video)
    assert seen.status == "poor_fit"
    assert "grey levels" in seen.reason
    assert np.isfinite(seen.vertices).all()
    assert np.isfinite(seen.poses).all()
