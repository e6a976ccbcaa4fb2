"""Polygons against shapely, which computes the same things in other ways."""

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from expert.errors import InvalidProblem
from expert.geometry.polygon import (
    contains,
    crossing_edges,
    diameter,
    facet_frames,
    facets,
    is_convex,
    mass_properties,
    reflex_vertices,
    signed_area,
    signed_distance,
    simple_polygon,
)
from expert.geometry.pose import Array, cross
from tests.support.polygons import AWKWARD, points_around, polygons


@given(polygons())
def test_area_and_centroid_agree_with_shapely(v: Array) -> None:
    plate, reference = mass_properties(v), shapely.Polygon(v)
    assert plate.area == pytest.approx(reference.area, rel=1e-9)
    np.testing.assert_allclose(plate.centroid, [reference.centroid.x, reference.centroid.y], atol=1e-12)


@pytest.mark.parametrize("name", AWKWARD)
def test_second_moment_agrees_with_a_sum_over_small_cells(name: str) -> None:
    v = AWKWARD[name]
    plate = mass_properties(v)
    low, high = v.min(axis=0), v.max(axis=0)
    middles = [lo + (np.arange(700) + 0.5) / 700 * (hi - lo) for lo, hi in zip(low, high, strict=True)]
    x, y = np.meshgrid(*middles)
    inside = shapely.contains_xy(shapely.Polygon(v), x, y)
    r2 = (x - plate.centroid[0]) ** 2 + (y - plate.centroid[1]) ** 2
    cell = np.prod((high - low) / 700)
    assert plate.second_moment == pytest.approx((r2 * inside).sum() * cell, rel=2e-2)


@given(polygons(), st.floats(-50, 50), st.floats(-50, 50))
def test_mass_properties_keep_their_digits_far_from_the_origin(v: Array, x: float, y: float) -> None:
    near, far = mass_properties(v), mass_properties(v + [x, y])
    assert far.area == pytest.approx(near.area, rel=1e-9)
    assert far.second_moment == pytest.approx(near.second_moment, rel=1e-7)
    np.testing.assert_allclose(far.centroid - [x, y], near.centroid, atol=1e-11)


def test_mass_properties_of_a_square_and_a_triangle() -> None:
    square = mass_properties(np.array([[0.0, 0], [2, 0], [2, 2], [0, 2]]))
    assert (square.area, square.centroid.tolist()) == (4.0, [1.0, 1.0])
    assert square.second_moment == pytest.approx(4 * (2**2 + 2**2) / 12)
    triangle = mass_properties(np.array([[0.0, 0], [3, 0], [0, 3]]))
    assert triangle.second_moment == pytest.approx(3**4 / 18)  # b h (b^2 + h^2) / 36


@given(polygons(), st.integers(0, 2**32 - 1))
def test_contains_and_distance_agree_with_shapely(v: Array, seed: int) -> None:
    reference = shapely.Polygon(v)
    x = points_around(v, 60, seed)
    places = shapely.points(x)
    distance = shapely.distance(reference.exterior, places)
    inside = shapely.contains(reference, places)
    clear = distance > 1e-12
    np.testing.assert_array_equal(contains(v, x)[clear], inside[clear])
    np.testing.assert_allclose(signed_distance(v, x), np.where(inside, -distance, distance), atol=1e-12)


@given(polygons())
def test_distance_vanishes_on_the_boundary(v: Array) -> None:
    a, b = facets(v)
    on_boundary = np.concatenate([a, 0.3 * a + 0.7 * b])
    np.testing.assert_allclose(signed_distance(v, on_boundary), 0, atol=1e-12)


@given(polygons())
def test_facet_frames_are_right_handed_and_point_inward(v: Array) -> None:
    normal, tangent = facet_frames(v)
    a, b = facets(v)
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1)
    np.testing.assert_allclose((normal * tangent).sum(axis=1), 0, atol=1e-12)
    np.testing.assert_allclose(cross(tangent, normal), 1)
    np.testing.assert_allclose(cross(tangent, b - a), 0, atol=1e-12)
    inside = (a + b) / 2 + 1e-7 * normal
    assert contains(v, inside).all()


@given(polygons(least=4))
def test_convex_means_equal_to_the_hull(v: Array) -> None:
    hull = shapely.MultiPoint(v).convex_hull
    missing = hull.area - shapely.Polygon(v).area
    if missing > 1e-7 * hull.area:
        assert not is_convex(v)
    if is_convex(v):
        assert missing <= 1e-7 * hull.area


@given(polygons())
def test_reflex_vertices_are_those_whose_neighbours_turn_right(v: Array) -> None:
    before, after = np.roll(v, 1, axis=0), np.roll(v, -1, axis=0)
    turn = np.arctan2(cross(v - before, after - v), ((v - before) * (after - v)).sum(axis=1))
    np.testing.assert_array_equal(reflex_vertices(v), turn < -1e-9)
    assert turn.sum() == pytest.approx(2 * np.pi)


@given(polygons())
def test_diameter_is_the_longest_chord(v: Array) -> None:
    chords = [np.linalg.norm(p - q) for p in v for q in v]
    assert diameter(v) == pytest.approx(max(chords))


@given(polygons(), st.integers(0, 8))
def test_either_order_gives_the_same_polygon_from_the_same_first_vertex(v: Array, start: int) -> None:
    listed = np.roll(v, -start, axis=0)
    np.testing.assert_array_equal(simple_polygon(listed.tolist(), field="v"), listed)
    backwards = np.concatenate([listed[:1], listed[:0:-1]])
    assert signed_area(backwards) < 0
    np.testing.assert_array_equal(simple_polygon(backwards.tolist(), field="v"), listed)


COORDINATE = st.integers(-3, 3) | st.floats(-3, 3)


@given(st.lists(st.tuples(COORDINATE, COORDINATE), min_size=3, max_size=7))
def test_accepted_polygons_are_valid_to_shapely_and_valid_ones_accepted(
    points: list[tuple[float, float]],
) -> None:
    reference = shapely.Polygon(points)
    try:
        v = simple_polygon(points, field="v")
    except InvalidProblem:
        edges = np.linalg.norm(np.diff([*points, points[0]], axis=0), axis=1)
        degenerate = edges.min() < 1e-8 or reference.area < 1e-7
        assert degenerate or not reference.is_valid
    else:
        assert reference.is_valid
        assert shapely.Polygon(v).equals(reference)


def test_crossing_edges_are_named() -> None:
    assert crossing_edges(np.array([[0.0, 0], [1, 1], [1, 0], [0, 1]])) == (0, 2)
    assert crossing_edges(np.array([[0.0, 0], [2, 0], [2, 2], [1, 0], [0, 2]])) is not None  # touches edge 0
    assert crossing_edges(AWKWARD["spiral"]) is None


def test_collinear_edges_apart_do_not_cross() -> None:
    """Two teeth of a comb stand on one line."""
    comb = np.array([[0, 0], [5, 0], [5, 2], [4, 2], [4, 1], [2, 1], [2, 2], [0, 2]], dtype=float)
    assert crossing_edges(comb) is None
    turned = comb @ np.array([[0.8, 0.6], [-0.6, 0.8]])  # only up to rounding on one line
    assert crossing_edges(turned) is None


def test_edges_that_only_touch_are_named() -> None:
    pinched = np.array([[0, 0], [4, 0], [4, 4], [2, 0], [0, 4]], dtype=float)  # a corner on an edge
    assert crossing_edges(pinched) == (0, 2)
    folded = np.array([[0, 0], [4, 0], [2, 0], [2, 3]], dtype=float)
    assert crossing_edges(folded) == (0, 1)
    bow = np.array([[0, 0], [2, 2], [2, 0], [0, 2]], dtype=float)
    assert crossing_edges(bow) == (0, 2)


@given(st.lists(st.tuples(st.integers(0, 6), st.integers(0, 6)), min_size=4, max_size=8, unique=True))
def test_crossing_edges_agree_with_shapely_on_grids(points: list[tuple[int, int]]) -> None:
    """Where lines through three points and shared coordinates are the rule."""
    v = np.array(points, dtype=float)
    edges = shapely.linestrings(np.stack([v, np.roll(v, -1, axis=0)], axis=1))
    n, meeting = len(v), []
    for i in range(n):
        for j in range(i + 1, n):
            common = edges[i].intersection(edges[j])
            neighbours = j == i + 1 or (i == 0 and j == n - 1)
            if not common.is_empty and not (neighbours and common.geom_type == "Point"):
                meeting.append((i, j))
    assert crossing_edges(v) == (meeting[0] if meeting else None)
