"""Swept sets hold at every orientation of their range."""

import numpy as np
import pytest
import shapely

from expert.geometry.cover import clip
from expert.geometry.polygon import signed_distance
from expert.geometry.pose import Array, rotation
from expert.loops.swept import SweptGeometry, swept_steps
from expert.world.frame import Frame
from expert.world.named import named_shape
from expert.world.shape import Shape
from tests.support.polygons import random_nonconvex_polygon


def geometry(vertices: Array, clearance: float = 1e-3) -> SweptGeometry:
    shape = Shape(vertices=vertices)
    return SweptGeometry(Frame.of(shape, np.zeros(3)).body(shape.vertices), clearance)


def test_swept_overlaps_hold_at_every_orientation_of_the_range() -> None:
    geo = geometry(named_shape("T"))
    low, high = np.radians(-12), np.radians(31)
    rng = np.random.default_rng(0)
    for (i, j), (A, b) in geo.overlaps(low, high).items():
        K = clip(9 * np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]]), A, b)
        for _ in range(20):
            gap = rng.dirichlet(np.ones(len(K))) @ K
            for angle in np.linspace(low, high, 60):
                first = shapely.Polygon(-geo.pieces[i] @ rotation(angle).T + gap)
                second = shapely.Polygon(-geo.pieces[j] @ rotation(angle).T)
                assert first.intersects(second)


@pytest.mark.parametrize("seed", range(6))
def test_regions_avoid_the_object_and_directions_separate(seed: int) -> None:
    geo = geometry(random_nonconvex_polygon(np.random.default_rng(seed), 5 + seed))
    square = 3 * np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])
    rng = np.random.default_rng(seed)
    for r, region in enumerate(geo.regions):
        corners = clip(square, region.A, region.b)
        points = rng.dirichlet(np.ones(len(corners)), 30) @ corners
        assert (signed_distance(geo.vertices, points) > 0).all()
        for i, piece in enumerate(geo.pieces):
            u = np.array([np.cos(geo.directions[r, i]), np.sin(geo.directions[r, i])])
            assert ((points[:, None] - piece[None]) @ u).min() > -1e-9
    i, j = np.nonzero(geo.meeting)
    assert (np.abs(geo.directions[:, i] - geo.directions[:, j]) < np.pi + 1e-9).all()


def test_steps_partition_a_range() -> None:
    steps = swept_steps(-0.3, 0.5)
    edges = [m - h for m, h in steps] + [steps[-1][0] + steps[-1][1]]
    assert edges[0] == pytest.approx(-0.3)
    assert edges[-1] == pytest.approx(0.5)
    assert max(np.diff(edges)) <= np.radians(2.5) + 1e-12


def test_what_two_pieces_share_over_a_range_is_in_both_at_every_orientation() -> None:
    geo = geometry(named_shape("T"))
    low, high = np.radians(5), np.radians(20)
    rng, seen = np.random.default_rng(0), 0
    for (i, j), (A, b) in geo.common(low, high, 1e-3).items():
        shared = clip(9 * np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]]), A, b)
        for angle in np.linspace(low, high, 31) if len(shared) > 2 else ():
            points = shapely.points(rng.dirichlet(np.ones(len(shared)), 20) @ shared @ rotation(angle))
            for piece in (i, j):
                assert shapely.contains(shapely.Polygon(geo.pieces[piece]), points).all()
            seen += 1
    assert seen > 60


def test_points_shared_at_one_orientation_are_the_turned_and_eroded_overlap() -> None:
    geo, angle, erosion = geometry(named_shape("T")), 0.4, 0.02
    for (i, j), (A, b) in geo.common(angle, angle, erosion).items():
        overlap = shapely.Polygon(geo.pieces[i]).intersection(shapely.Polygon(geo.pieces[j]))
        expected = shapely.affinity.rotate(overlap, angle, origin=(0, 0), use_radians=True).buffer(-erosion)
        found = shapely.Polygon(clip(9 * np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]]), A, b))
        assert found.symmetric_difference(expected).area == pytest.approx(0, abs=1e-9)
