"""Convex pieces partition a polygon; convex regions cover exactly its outside."""

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from expert.geometry.convex import Region, convex_pieces, free_regions
from expert.geometry.polygon import is_convex, reflex_vertices, signed_area, signed_distance
from expert.geometry.pose import Array
from tests.support.polygons import AWKWARD, points_around, polygons


def depth(regions: list[Region], points: Array) -> Array:
    """How deep points (n, 2) lie in the region that holds them most deeply [m], negative outside of all."""
    return np.max([(r.b - points @ r.A.T).min(axis=1) for r in regions], axis=0)


@given(polygons())
def test_convex_pieces_partition_the_polygon(v: Array) -> None:
    pieces = convex_pieces(v)
    assert all(is_convex(piece) and signed_area(piece) > 0 for piece in pieces)
    whole = shapely.Polygon(v)
    assert sum(signed_area(piece) for piece in pieces) == pytest.approx(whole.area, rel=1e-9)
    together = shapely.union_all([shapely.Polygon(piece).buffer(1e-9) for piece in pieces])
    assert together.symmetric_difference(whole).area <= 1e-6 * whole.area + 1e-9


@given(polygons())
def test_there_are_at_most_four_times_as_many_pieces_as_needed(v: Array) -> None:
    """Hertel and Mehlhorn: a reflex vertex keeps at most two diagonals."""
    assert len(convex_pieces(v)) <= 2 * reflex_vertices(v).sum() + 1


@given(polygons())
def test_pieces_use_the_polygon_s_own_vertices(v: Array) -> None:
    own = {tuple(p) for p in v}
    assert all(tuple(p) in own for piece in convex_pieces(v) for p in piece)


@given(polygons(), st.integers(0, 2**32 - 1))
def test_free_regions_cover_exactly_the_outside(v: Array, seed: int) -> None:
    x = points_around(v, 80, seed)
    distance = signed_distance(v, x)
    inside_some = depth(free_regions(v), x)
    assert (inside_some[distance > 1e-9] > -1e-9).all()
    assert (inside_some[distance < -1e-9] < 1e-9).all()


@given(polygons(), st.integers(0, 2**32 - 1), st.floats(1e-4, 8e-3))
def test_free_regions_with_clearance_keep_it(v: Array, seed: int, clearance: float) -> None:
    x = points_around(v, 80, seed)
    held = depth(free_regions(v, clearance), x) >= 0
    assert (signed_distance(v, x)[held] >= clearance - 1e-9).all()


@given(polygons(), st.integers(0, 2**32 - 1), st.floats(1e-4, 8e-3))
def test_free_regions_with_clearance_leave_out_no_more_than_sharp_corners_ask_for(
    v: Array, seed: int, clearance: float
) -> None:
    x = points_around(v, 80, seed)
    grown = shapely.Polygon(v).buffer(clearance, join_style="mitre", mitre_limit=1e3)
    outside = shapely.distance(shapely.Polygon(grown.exterior), shapely.points(x)) > 1e-9
    assert (depth(free_regions(v, clearance), x)[outside] > -1e-9).all()


@given(polygons())
def test_region_of_a_convex_polygon_is_the_polygon(v: Array) -> None:
    for piece in convex_pieces(v):
        region = Region.of_polygon(piece)
        np.testing.assert_allclose(np.linalg.norm(region.A, axis=1), 1)
        x = points_around(piece, 40, 0)
        np.testing.assert_array_equal(
            (x @ region.A.T <= region.b).all(axis=1), shapely.contains_xy(shapely.Polygon(piece), *x.T)
        )


def test_pieces_of_known_shapes() -> None:
    assert len(convex_pieces(AWKWARD["L"])) == 2
    assert len(convex_pieces(AWKWARD["T"])) == 2
    assert len(convex_pieces(AWKWARD["collinear vertices"])) == 1
    assert len(free_regions(AWKWARD["collinear vertices"])) == 4
    assert len(free_regions(AWKWARD["L"])) == 5 + 1
