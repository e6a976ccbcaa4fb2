"""The fit finds what explains the pixels."""

from dataclasses import replace

import numpy as np
import pytest

from dlm.perception.contacts import snap_contacts
from dlm.perception.fit import (
    MovingPolygon,
    Observation,
    calibrated,
    fit,
    modelled,
    quadratic,
    without_outliers,
)
from dlm.perception.prune import prune, straightness, without_tangles
from expert.geometry.pose import rotation

PENTAGON = np.array([[5.0, 6.0], [14.0, 6.0], [17.0, 11.0], [10.0, 17.0], [4.0, 12.0]])
MOTION = np.array([[0.0, 0.0, 0.0], [0.4, 1.3, 0.2], [1.2, 2.1, 0.5]])
TRUTH = MovingPolygon(PENTAGON, MOTION, np.array([10.0, 10.0]))


def observed(scene: MovingPolygon, blur: float = 0.0, deviation: float = 0.01, seed: int = 0) -> Observation:
    """What a camera with some noise sees of it."""
    blank = np.zeros((len(scene.motion), 28, 28))
    seen = Observation(blank, blank + deviation**-2, np.zeros((len(blank), 2)), blur)
    share, _ = modelled(scene, seen)
    return replace(seen, share=share + np.random.default_rng(seed).normal(0, deviation, share.shape))


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


def test_needless_corners_go_and_needed_ones_stay() -> None:
    middles = (PENTAGON + np.roll(PENTAGON, -1, axis=0)) / 2
    doubled = np.stack([PENTAGON, middles], axis=1).reshape(-1, 2)
    found, _ = prune(replace(TRUTH, vertices=doubled), observed(TRUTH))
    assert len(found.vertices) == 5
    assert np.abs(found.vertices - PENTAGON).max() < 0.1


def test_straight_corners_cost_nothing_and_sharp_ones_much() -> None:
    with_middle = np.insert(PENTAGON, 1, [9.0, 6.0], axis=0)
    scene = replace(TRUTH, vertices=with_middle)
    rise = straightness(scene, quadratic(scene, observed(TRUTH)))
    assert rise.argmin() == 1
    assert rise[1] < 1e-9
    assert straightness(TRUTH, quadratic(TRUTH, observed(TRUTH))).min() > 100


def test_tangles_are_cut_off() -> None:
    loop = np.insert(PENTAGON, 2, [[18.0, 12.0], [18.0, 9.0], [15.0, 9.2]], axis=0)
    assert len(without_tangles(loop)) < len(loop)
    short = np.insert(PENTAGON, 1, [13.9, 6.0], axis=0)
    assert len(without_tangles(short)) == len(PENTAGON)
    assert np.array_equal(without_tangles(PENTAGON), PENTAGON)


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


def test_contacts_are_exact_and_nothing_enters_the_floor() -> None:
    """A pivot about the right end of the side at rest: it stays where it is."""
    corner = PENTAGON[1]
    motion = np.zeros((3, 3))
    for t, angle in enumerate([0.0, -0.15, -0.4]):
        shift = corner - TRUTH.centre - rotation(angle) @ (corner - TRUTH.centre)
        motion[t] = [*shift, angle]
    seen = observed(MovingPolygon(PENTAGON, motion, TRUTH.centre), deviation=0.03)
    rough, _ = fit(MovingPolygon(PENTAGON + 0.05, motion, TRUTH.centre), seen)
    found = snap_contacts(rough, seen, floor=6.0, reach=0.25).placed()
    assert np.abs(found[0, :2, 1] - 6).max() < 1e-8
    assert np.abs(found[:, 1] - found[0, 1]).max() < 1e-8
    assert found[..., 1].min() > 6 - 1e-8
    assert found[1, 0, 1] > 6.5


def test_a_gap_that_the_data_shows_stays() -> None:
    motion = np.array([[0.0, 0.0, 0.0], [0.0, 0.2, 0.0]])
    seen = observed(MovingPolygon(PENTAGON, motion, TRUTH.centre))
    found = snap_contacts(MovingPolygon(PENTAGON, motion, TRUTH.centre), seen, floor=6.0, reach=0.25).placed()
    assert np.abs(found[0, :2, 1] - 6).max() < 1e-8
    assert np.abs(found[1, :2, 1] - 6.2).max() < 0.03
