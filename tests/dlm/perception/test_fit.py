"""The fit finds what explains the pixels."""

from dataclasses import replace

import numpy as np
import pytest

from dlm.perception.fit import (
    MovingPolygon,
    calibrated,
    fit,
    modelled,
    quadratic,
    without_outliers,
)
from tests.support.moving_polygon import MOTION, PENTAGON, TRUTH, observed


def disturbed(seed: int) -> MovingPolygon:
    rng = np.random.default_rng(seed)
    motion = MOTION + rng.normal(0, [0.3, 0.3, 0.05], MOTION.shape)
    motion[0] = 0
    return MovingPolygon(PENTAGON + rng.normal(0, 0.4, PENTAGON.shape), motion, TRUTH.centre)


@pytest.mark.parametrize("blur", [0.0, 1.2])
@pytest.mark.parametrize("seed", range(3))
def test_cost_and_gradient_agree_with_differences(seed: int, blur: float) -> None:
    scene, seen = disturbed(seed), observed(TRUTH, blur)
    direction = np.random.default_rng(seed).normal(size=PENTAGON.size + 3 * (len(MOTION) - 1))
    ahead, behind = (quadratic(scene.moved(h * direction), seen).cost for h in (1e-6, -1e-6))
    assert quadratic(scene, seen).gradient @ direction == pytest.approx((ahead - behind) / 2e-6, rel=1e-4)


@pytest.mark.parametrize("blur", [0.0, 1.2])
def test_the_matrix_is_that_of_the_linearised_pixels(blur: float) -> None:
    scene, seen = disturbed(1), observed(TRUTH, blur)
    size = PENTAGON.size + 3 * (len(MOTION) - 1)
    columns = [
        (modelled(scene.moved(1e-6 * e), seen)[0] - modelled(scene.moved(-1e-6 * e), seen)[0]).ravel() / 2e-6
        for e in np.eye(size)
    ]
    slopes = np.array(columns).T
    expected = slopes.T @ (seen.weight.ravel()[:, None] * slopes)
    assert np.allclose(quadratic(scene, seen).matrix, expected, rtol=1e-4, atol=1e-4 * expected.max())


@pytest.mark.parametrize("blur", [0.0, 1.2])
@pytest.mark.parametrize("seed", range(6))
def test_vertices_and_motion_are_found_from_nearby(seed: int, blur: float) -> None:
    found, _ = fit(disturbed(seed), observed(TRUTH, blur, deviation=1e-6), iterations=100, precision=1e-9)
    assert np.abs(found.vertices - PENTAGON).max() < 1e-3
    assert np.abs(found.motion - MOTION).max() < 1e-3


def test_a_scene_is_the_same_whichever_step_describes_it() -> None:
    turned = replace(TRUTH, motion=MOTION + [0.3, -0.2, 0.7])
    again = turned.seen_from_first_step()
    assert np.allclose(again.placed(), turned.placed())
    assert np.array_equal(again.motion[0], np.zeros(3))


def test_what_hides_the_object_loses_its_weight() -> None:
    seen = observed(TRUTH)
    share = seen.share.copy()
    share[1, 8:12, 5:9] = 0
    trusted = without_outliers(TRUTH, replace(seen, share=share))
    lost = np.argwhere(trusted.weight == 0)
    assert len(lost) > 8
    assert set(lost[:, 0]) == {1}
    assert lost[:, 1].min() >= 8
    assert lost[:, 2].max() < 9


def test_the_contrast_is_corrected() -> None:
    seen = observed(TRUTH)
    off = replace(seen, share=1.1 * seen.share)
    assert np.allclose(calibrated(TRUTH, off).share, seen.share, atol=2e-3)
