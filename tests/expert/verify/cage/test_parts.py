"""A cover is not believed: parts that leave the object count for nothing, and no sabotaged cover makes a cage."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from expert.geometry.cover import overlapping_cover
from expert.geometry.pose import Array
from expert.problems.cage import Arrangement
from expert.verify.cage import cells
from expert.verify.cage.check import verify_cage
from expert.verify.cage.parts import inside_parts, is_inside
from expert.world.shape import Shape
from tests.support.polygons import polygons

CHANNEL = np.array([[0, 0], [6, 0], [6, 2], [2, 2], [2, 4], [6, 4], [6, 6], [0, 6]]) - 3.0
IN_ITS_MOUTH = np.array([[3.05, 0.0], [-3.05, -1.0], [-1.0, 3.05], [1.0, -3.05]])
"""The hull would be caged; the channel leaves over the first finger."""


def hull(vertices: Array) -> list[Array]:
    ring = shapely.geometry.polygon.orient(shapely.MultiPoint(vertices).convex_hull)
    return [np.array(ring.exterior.coords)[:-1]]


@settings(max_examples=100, deadline=None)
@given(polygons(most=12))
def test_the_usual_cover_is_believed(polygon: Array) -> None:
    polygon = (polygon - polygon.mean(axis=0)) / np.ptp(polygon, axis=0).max()
    cover = overlapping_cover(polygon)
    sizeable = [p for p in cover if not shapely.Polygon(p).buffer(-1e-8).is_empty]
    assert all(is_inside(polygon, part) for part in sizeable)


@settings(max_examples=100, deadline=None)
@given(polygons(most=12), st.data())
def test_parts_that_are_believed_lie_inside(polygon: Array, data: st.DataObject) -> None:
    polygon = (polygon - polygon.mean(axis=0)) / np.ptp(polygon, axis=0).max()
    cover = [part.copy() for part in overlapping_cover(polygon)]
    for part in cover:  # sabotage: corners moved by anything from rounding to the object's size
        move = 10.0 ** data.draw(st.integers(-10, 0))
        part[data.draw(st.integers(0, len(part) - 1))] += move * np.array(
            [data.draw(st.floats(-1, 1)), data.draw(st.floats(-1, 1))]
        )
    whole = shapely.Polygon(polygon).buffer(3e-9, join_style="mitre")
    for part in inside_parts(polygon, [*cover, *hull(polygon)]):
        solid = shapely.MultiPoint(part).convex_hull if _is_convex(part) else None
        assert solid is None or whole.covers(solid.buffer(-2e-9)), solid


def _is_convex(part: Array) -> bool:
    """Where it is not, its half-planes meet in less than its corners' hull."""
    return bool(
        shapely.Polygon(part).is_valid and shapely.Polygon(part).equals(shapely.MultiPoint(part).convex_hull)
    )


def test_clockwise_and_reflex_parts_are_not_believed_to_be_more_than_they_are() -> None:
    assert not is_inside(CHANNEL, hull(CHANNEL)[0])
    assert not is_inside(CHANNEL, CHANNEL[:4][::-1])
    assert is_inside(CHANNEL, CHANNEL[[0, 1, 2, 3]])
    assert not is_inside(CHANNEL, CHANNEL[[0, 1, 2, 3]] - [1e-6, 0])


def test_a_sabotaged_cover_makes_no_cage(monkeypatch: pytest.MonkeyPatch) -> None:
    arrangement = Arrangement(shape=Shape(vertices=CHANNEL), pose=np.zeros(3), fingers=IN_ITS_MOUTH)
    assert verify_cage(arrangement).verdict == "escapes"
    for kept in ("_relative_cover", "_sure_parts", "_inner_shape", "_outer_shape"):
        getattr(cells, kept).cache_clear()
    monkeypatch.setattr(cells, "overlapping_cover", hull)
    try:
        assert verify_cage(arrangement).verdict == "unknown"
        monkeypatch.setattr(cells, "inside_parts", lambda vertices, parts: list(parts))  # the check matters
        cells._sure_parts.cache_clear()
        cells._inner_shape.cache_clear()
        assert verify_cage(arrangement).verdict == "caged"
    finally:
        for kept in ("_relative_cover", "_sure_parts", "_inner_shape", "_outer_shape"):
            getattr(cells, kept).cache_clear()
