"""Covers: convex, inside, complete, and overlapping so that erosion opens no seam."""

import numpy as np
import pytest
import shapely

from expert.geometry.cover import clip, half_planes, overlapping_cover
from expert.geometry.polygon import diameter, is_convex, simple_polygon
from expert.geometry.pose import Array
from expert.world.named import named_shape
from tests.support.polygons import CAGED, random_polygon

POLYGONS = [named_shape(name) for name in CAGED] + [
    random_polygon(np.random.default_rng(k), 4 + k % 9) for k in range(40)
]


@pytest.mark.parametrize("polygon", POLYGONS)
def test_a_cover_is_convex_inside_and_seamless(polygon: Array) -> None:
    v = simple_polygon(polygon, field="object")
    whole, pieces = shapely.Polygon(v), [shapely.Polygon(p) for p in overlapping_cover(v)]
    assert all(is_convex(np.array(p.exterior.coords)[:-1]) for p in pieces)
    assert all(p.difference(whole).area <= 1e-12 * whole.area for p in pieces)
    assert whole.difference(shapely.union_all(pieces)).area <= 1e-12 * whole.area
    depth = 1e-4 * diameter(v)
    eroded = shapely.union_all([p.buffer(-depth, join_style="mitre") for p in pieces])
    lost = whole.buffer(-depth, join_style="mitre").difference(eroded).area
    assert eroded.geom_type == "Polygon"
    assert lost <= 50 * depth**2  # notches at reflex corners, no slits along seams


def test_clip_equals_intersection() -> None:
    rng = np.random.default_rng(1)
    for _ in range(50):
        a, b = (
            np.array(
                shapely.geometry.polygon.orient(
                    shapely.MultiPoint(rng.normal(size=(7, 2))).convex_hull
                ).exterior.coords
            )[:-1]
            for _ in range(2)
        )
        ours = clip(a, *half_planes(b))
        truth = shapely.Polygon(a).intersection(shapely.Polygon(b))
        area = shapely.Polygon(ours).area if len(ours) >= 3 else 0.0
        assert area == pytest.approx(truth.area, abs=1e-12)


def test_clip_writes_no_more_corners_than_it_has_room_for() -> None:
    """A zigzag, which no convex polygon is, crosses the line at every edge."""
    zigzag = np.array([[k, (-1.0) ** k] for k in range(20)])
    cut = clip(zigzag, np.array([[0.0, 1.0]]), np.array([0.0]))
    assert len(cut) == 10 + 20
    assert (cut[:, 1] <= 0).all()
