"""Disturbances change videos by what they say, and nothing else."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from datasets.disturb import (
    DISTURBANCES,
    blurred,
    noisy,
    occluded,
    random_light,
    random_palette,
    unevenly_lit,
)
from datasets.render import render
from expert.errors import InvalidProblem

SQUARE = 0.03 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
VIDEO = render(SQUARE, np.array([[0.0, 0.06, 0.0], [0.01, 0.08, 0.3]]))
GREY = np.full((3, 40, 40, 3), 128, dtype=np.uint8)


def generator(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


@pytest.mark.parametrize("name", DISTURBANCES)
def test_shape_and_type_stay_the_original_is_not_touched_and_seeds_repeat(name: str) -> None:
    before = VIDEO.copy()
    out, again = (DISTURBANCES[name](VIDEO, generator(4)) for _ in range(2))
    assert out.shape == VIDEO.shape
    assert out.dtype == np.uint8
    assert np.array_equal(VIDEO, before)
    assert np.array_equal(out, again)
    assert np.array_equal(out, VIDEO) == (name == "clean")


@pytest.mark.parametrize("deviation", [3, 5, 15])
def test_noise_has_its_deviation_and_no_pattern(deviation: float) -> None:
    off = noisy(GREY, deviation, generator()).astype(float) - 128
    assert off.std() == pytest.approx(np.hypot(deviation, 12**-0.5), rel=0.05)
    assert abs(off.mean()) < 0.1 * deviation
    flat = off.reshape(-1, 3)
    assert np.abs(np.corrcoef(flat.T) - np.eye(3)).max() < 0.05


def test_blur_keeps_the_mean_and_spreads_a_dot_by_its_deviation() -> None:
    dot = np.zeros((1, 41, 41, 3), dtype=np.uint8)
    dot[0, 18:23, 18:23] = 250
    out = blurred(dot, 1.5)[0, ..., 0].astype(float)
    assert out.sum() == pytest.approx(25 * 250, rel=0.02)
    place = np.arange(41) - 20
    variance = (out.sum(axis=0) * place**2).sum() / out.sum()
    assert variance == pytest.approx(2 + 1.5**2, rel=0.05)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32), patches=st.integers(0, 4))
def test_patches_hide_the_same_rectangles_in_all_frames(seed: int, patches: int) -> None:
    out = occluded(GREY, patches, (3, 8), generator(seed))
    assert (out == out[0]).all()
    changed = (out[0] != GREY[0]).any(axis=-1)
    assert changed.sum() <= patches * 64
    pieces, _, stats, _ = cv2.connectedComponentsWithStats(changed.astype(np.uint8), connectivity=8)
    assert pieces - 1 <= patches
    assert (stats[1:, 2:4] >= 3).all()


def test_light_falls_off_from_one_side_to_the_other() -> None:
    lit = unevenly_lit(GREY, np.array([0.5, 0.0])).astype(float)
    assert lit[..., 0, :].mean() == pytest.approx(128 * 0.75, rel=0.02)
    assert lit[..., -1, :].mean() == pytest.approx(128 * 1.25, rel=0.02)
    assert np.ptp(lit, axis=1).max() == 0
    upward = unevenly_lit(GREY, np.array([0.0, 0.5])).astype(float)
    assert upward[:, 0].mean() > upward[:, -1].mean()


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_random_light_never_saturates(seed: int) -> None:
    white = np.full((1, 30, 30, 3), 255, dtype=np.uint8)
    lit = random_light(white, generator(seed))
    assert lit.max() <= 255
    assert (lit == 255).mean() < 0.01
    assert np.ptp(lit) > 60


@settings(max_examples=50, deadline=None)
@given(seed=st.integers(0, 2**32), contrast=st.floats(0, 180))
def test_colours_differ_as_much_as_asked(seed: int, contrast: float) -> None:
    palette = random_palette(generator(seed), contrast)
    colours = np.array([palette.background, palette.object, palette.ground], dtype=float)
    for i in range(3):
        assert np.linalg.norm(colours[i] - colours[i - 1]) >= contrast


@pytest.mark.parametrize(
    ("make", "field"),
    [
        (lambda: noisy(GREY, -1, generator()), "noise.deviation"),
        (lambda: noisy(GREY, float("nan"), generator()), "noise.deviation"),
        (lambda: blurred(GREY, 0.0), "blur.deviation"),
        (lambda: occluded(GREY, 1, (5, 80), generator()), "occlusion.size"),
        (lambda: occluded(GREY, -1, (3, 5), generator()), "occlusion.patches"),
        (lambda: unevenly_lit(GREY, np.array([2.0, 1.0])), "light.slope"),
        (lambda: random_palette(generator(), 500), "palette.contrast"),
    ],
)
def test_senseless_disturbances_are_refused_by_name(make, field: str) -> None:
    with pytest.raises(InvalidProblem, match=f"^{field}: expected "):
        make()
