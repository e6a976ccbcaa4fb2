"""Shapes and their convex pieces; bodies and their mass."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from expert.errors import InvalidProblem
from expert.geometry.polygon import signed_area
from expert.geometry.pose import to_world
from expert.world.shape import Body, Shape
from tests.support.polygons import random_nonconvex_polygon, random_polygon

SQUARE = [[0, 0], [1, 0], [1, 1], [0, 1]]
LEFT, RIGHT = SQUARE, [[1, 0], [2, 0], [2, 1], [1, 1]]
SEEDS = st.integers(0, 10**6)


def test_pieces_become_their_union() -> None:
    shape = Shape.of_pieces([LEFT, RIGHT, [[0.5, 0.2], [1.5, 0.2], [1, 0.8]]])
    assert signed_area(shape.vertices) == pytest.approx(2)
    assert len(shape.vertices) == 4
    assert len(shape.pieces) == 3


@given(SEEDS)
@settings(max_examples=30, deadline=None)
def test_own_pieces_are_convex_and_cover_the_shape_without_overlap(seed: int) -> None:
    shape = Shape(vertices=random_nonconvex_polygon(np.random.default_rng(seed), 5 + seed % 5))
    pieces = [shapely.Polygon(p) for p in shape.pieces]
    assert len(pieces) >= 2
    area = shapely.Polygon(shape.vertices).area
    assert sum(p.area for p in pieces) == pytest.approx(area, rel=1e-8)
    assert shapely.union_all(pieces).area == pytest.approx(area, rel=1e-8)
    for piece in pieces:
        assert piece.convex_hull.area == pytest.approx(piece.area, rel=1e-8)


@given(SEEDS, st.floats(-3, 3))
@settings(max_examples=30, deadline=None)
def test_facet_frames_point_inward_and_along(seed: int, angle: float) -> None:
    shape = Shape(vertices=random_polygon(np.random.default_rng(seed), 6))
    pose = np.array([0.3, -0.2, angle])
    a, b = shape.facets_w(pose)
    normal, tangent = shape.frames_w(pose)
    outline = shapely.Polygon(to_world(pose, shape.vertices))
    np.testing.assert_allclose(tangent, (b - a) / np.linalg.norm(b - a, axis=1)[:, None], atol=1e-12)
    np.testing.assert_allclose((normal * tangent).sum(axis=1), 0, atol=1e-12)
    for k, start in enumerate((a + b) / 2):
        assert outline.contains(shapely.Point(start + 1e-6 * normal[k]))


def test_a_uniform_body_lies_about_its_centroid() -> None:
    body, centroid = Body.uniform([[0, 0], [0.2, 0], [0.2, 0.1], [0, 0.1]], 3.0)
    np.testing.assert_allclose(centroid, [0.1, 0.05])
    assert body.inertia == pytest.approx(3 * (0.2**2 + 0.1**2) / 12)
    moved, centre = Body.uniform([[0, 0], [0.2, 0], [0.2, 0.1], [0, 0.1]], 3.0, np.array([0.0, 0.05]))
    np.testing.assert_allclose(moved.vertices, [[0, -0.05], [0.2, -0.05], [0.2, 0.05], [0, 0.05]])
    np.testing.assert_array_equal(centre, [0, 0.05])
    assert moved.inertia == pytest.approx(body.inertia + 3 * 0.1**2)


@pytest.mark.parametrize("mass", [0, -1, np.nan, np.inf])
def test_a_body_has_mass(mass: float) -> None:
    with pytest.raises(InvalidProblem, match=r"^object\.mass: "):
        Body.uniform(SQUARE, mass)
    with pytest.raises(InvalidProblem, match=r"^object\.inertia: "):
        Body(vertices=np.array(SQUARE), mass=1.0, inertia=mass)
