"""Coverage is exact, and so is its gradient."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from datasets.shapes import Shapes
from datasets.shapes_omnipush import OmniPush
from dlm.perception.raster import coverage, is_simple
from expert.geometry.polygon import crossing_edges, signed_area
from expert.geometry.pose import Array

HEIGHT, WIDTH = 24, 30
seeds = st.integers(0, 2**32)


def polygon(seed: int) -> Array:
    """Somewhere in the window, turned anyhow; every other one is not convex [pixels]."""
    rng = np.random.default_rng(seed)
    shape = OmniPush() if seed % 2 else Shapes(facets=(3, 12), least_length=0.0, shortest_facet=0.1)
    return shape.sample(rng) / rng.uniform(0.005, 0.01) + rng.uniform([12, 10], [18, 14])


def shares(vertices: Array, origin: tuple[float, float] = (0, 0)) -> tuple[Array, Array]:
    share, gradient = coverage(vertices[None], np.array([origin], dtype=float), HEIGHT, WIDTH)
    return share[0], gradient[0]


def clipped(vertices: Array) -> Array:
    columns, rows = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    pixels = shapely.box(columns, rows, columns + 1, rows + 1)
    return shapely.area(shapely.intersection(shapely.Polygon(vertices), pixels))


@settings(max_examples=60, deadline=None)
@given(seed=seeds)
def test_coverage_is_that_of_polygon_clipping(seed: int) -> None:
    assert np.abs(shares(polygon(seed))[0] - clipped(polygon(seed))).max() < 1e-12


@settings(max_examples=60, deadline=None)
@given(seed=seeds, x=st.integers(-9, 9), y=st.integers(-9, 9))
def test_it_sums_to_the_area_and_moves_with_the_polygon(seed: int, x: int, y: int) -> None:
    vertices = polygon(seed)
    share, gradient = shares(vertices)
    assert share.sum() == pytest.approx(signed_area(vertices), abs=1e-10)
    moved, moved_gradient = shares(vertices + [x, y], (x, y))
    assert np.allclose(moved, share, atol=1e-10)
    assert np.allclose(moved_gradient, gradient, atol=1e-10)


@settings(max_examples=30, deadline=None)
@given(seed=seeds, x=st.integers(-25, 25), y=st.integers(-20, 20))
def test_what_lies_outside_the_window_is_cut_off(seed: int, x: int, y: int) -> None:
    vertices = polygon(seed) + [x, y]
    assert np.abs(shares(vertices)[0] - clipped(vertices)).max() < 1e-12


@settings(max_examples=60, deadline=None)
@given(seed=seeds)
def test_the_gradient_is_that_of_differences(seed: int) -> None:
    vertices = polygon(seed)
    direction = np.random.default_rng(seed).normal(size=vertices.shape)
    ahead, behind = (shares(vertices + h * direction)[0] for h in (1e-6, -1e-6))
    slope = (shares(vertices)[1] * direction).sum(axis=(-1, -2))
    assert np.abs(slope - (ahead - behind) / 2e-6).max() < 1e-5


def test_edges_on_grid_lines_cover_whole_pixels() -> None:
    square = np.array([[3.0, 4.0], [8.0, 4.0], [8.0, 6.0], [3.0, 6.0]])
    share = shares(square)[0]
    assert share[4:6, 3:8].min() == share.max() == 1
    assert share.sum() == 10


@settings(max_examples=60, deadline=None)
@given(seed=seeds, swap=st.integers(0, 50))
def test_an_outline_that_crosses_itself_is_noticed(seed: int, swap: int) -> None:
    vertices = polygon(seed)
    assert is_simple(vertices)
    k = swap % len(vertices)
    other = (k + 2) % len(vertices)
    vertices[[k, other]] = vertices[[other, k]]
    if crossing_edges(vertices) is not None:
        assert not is_simple(vertices)
