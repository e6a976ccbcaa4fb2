"""Random objects keep what their distribution promises."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from datasets.shapes import Shapes, exterior_angles, facet_lengths, sample_polygon, stable_angles
from expert.errors import InvalidProblem
from expert.geometry.polygon import diameter, is_convex, mass_properties, simple_polygon
from expert.geometry.pose import to_world

KINDS = [Shapes(), Shapes(facets=(12, 12)), Shapes(facets=(3, 3), diameter=(0.02, 0.03))]


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32), kind=st.sampled_from(KINDS))
def test_polygons_are_simple_centred_and_within_all_limits(seed: int, kind: Shapes) -> None:
    polygon = sample_polygon(np.random.default_rng(seed), kind)
    assert np.array_equal(simple_polygon(polygon, field="object"), polygon)  # counter-clockwise too
    assert kind.facets[0] <= len(polygon) <= kind.facets[1]
    assert kind.diameter[0] <= diameter(polygon) <= kind.diameter[1]
    assert np.abs(mass_properties(polygon).centroid).max() < 1e-12
    lengths, turns = facet_lengths(polygon), exterior_angles(polygon)
    assert lengths.min() >= max(kind.shortest_facet * lengths.mean(), kind.least_length)
    assert turns.max() <= np.pi - kind.sharpest_corner
    assert turns.min() >= -kind.deepest_dent
    assert np.abs(turns).min() >= kind.slightest_turn
    assert turns.sum() == pytest.approx(2 * np.pi)


def test_most_shapes_are_convex_but_not_all_and_all_facet_counts_occur() -> None:
    rng = np.random.default_rng(0)
    polygons = [sample_polygon(rng, Shapes()) for _ in range(400)]
    assert 0.9 < np.mean([is_convex(p) for p in polygons]) < 1
    counts = np.bincount([len(p) for p in polygons], minlength=7)[4:]
    assert counts.min() > 100


def test_the_same_seed_gives_the_same_polygon_and_another_one_another() -> None:
    first, again, other = (sample_polygon(np.random.default_rng(s), Shapes()) for s in (5, 5, 6))
    assert np.array_equal(first, again)
    assert first.shape != other.shape or not np.allclose(first, other)


def test_a_square_is_stable_on_its_four_sides_and_a_leaning_triangle_on_two() -> None:
    square = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) / 20
    assert np.allclose(
        np.sort(np.mod(stable_angles(square, np.zeros(2)), 2 * np.pi)), np.pi / 2 * np.arange(4)
    )
    leaning = np.array([[0.0, 0.0], [0.02, 0.0], [0.09, 0.06]])  # its weight falls beyond the short side
    assert len(stable_angles(leaning, mass_properties(leaning).centroid)) == 2


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32), kind=st.sampled_from(KINDS))
def test_at_a_stable_angle_two_vertices_lie_lowest_on_either_side_of_the_weight(
    seed: int, kind: Shapes
) -> None:
    polygon = sample_polygon(np.random.default_rng(seed), kind)
    for angle in stable_angles(polygon, np.zeros(2)):
        turned = to_world([0, 0, angle], polygon)
        lowest = turned[turned[:, 1] < turned[:, 1].min() + 1e-9]
        assert len(lowest) >= 2
        assert lowest[:, 0].min() < 0 < lowest[:, 0].max()


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"facets": (2, 4)}, "shapes.facets"),
        ({"facets": (6, 4)}, "shapes.facets"),
        ({"facets": (4.5, 6)}, "shapes.facets"),
        ({"facets": "many"}, "shapes.facets"),
        ({"diameter": (0.1, 0.05)}, "shapes.diameter"),
        ({"diameter": (0.0, 0.05)}, "shapes.diameter"),
        ({"diameter": (0.05, float("nan"))}, "shapes.diameter"),
        ({"shortest_facet": 1.0}, "shapes.shortest_facet"),
        ({"least_length": 0.05}, "shapes.least_length"),
        ({"sharpest_corner": 4.0}, "shapes.sharpest_corner"),
    ],
)
def test_senseless_limits_are_refused_by_name(change: dict, field: str) -> None:
    with pytest.raises(InvalidProblem, match=f"^{field}: expected "):
        Shapes(**change)


def test_limits_that_no_polygon_meets_are_reported() -> None:
    with pytest.raises(InvalidProblem, match=r"^shapes: expected limits that polygons of 12 facets can meet"):
        sample_polygon(np.random.default_rng(0), Shapes(facets=(12, 12), slightest_turn=1.0))
