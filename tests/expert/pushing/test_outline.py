import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from expert.pushing.outline import clearance, distance_up_to, outline, touch
from tests.support.pushing import TEE

ORIGIN = np.array([0.0, 45.0])
EDGES = outline(TEE, ORIGIN)
PIECES = [shapely.Polygon(piece - ORIGIN) for piece in TEE.pieces]
coordinates = st.floats(-150, 150)


@given(coordinates, coordinates)
def test_distance_is_that_of_shapely_with_a_sign(x, y):
    point = shapely.Point(x, y)
    for k, piece in enumerate(PIECES):
        distance = touch(EDGES, k, x, y).distance
        expected = piece.exterior.distance(point)
        assert abs(distance) == pytest.approx(expected, abs=1e-9)
        assert distance <= 0 or not piece.contains(point)
        assert distance_up_to(EDGES, k, x, y, 20.0) == pytest.approx(min(distance, 20.0), abs=1e-9)


@given(coordinates, coordinates)
def test_normal_leads_from_the_point_to_the_nearest_point_of_the_boundary(x, y):
    for k, piece in enumerate(PIECES):
        t = touch(EDGES, k, x, y)
        assert np.hypot(t.nx, t.ny) == pytest.approx(1)
        assert piece.exterior.distance(shapely.Point(t.x, t.y)) < 1e-9
        assert (x + t.distance * t.nx, y + t.distance * t.ny) == pytest.approx((t.x, t.y), abs=1e-9)


def test_clearance_is_that_of_the_nearest_piece():
    assert clearance(EDGES, 0.0, -60.0) == pytest.approx(15)
    assert clearance(EDGES, 30.0, 0.0) == pytest.approx(15)  # in the corner of bar and stem
