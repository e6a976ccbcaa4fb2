"""Objects in files: shapes, bodies and their origin, and the numbering of clockwise lists."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from expert.errors import InvalidProblem
from expert.files.objects import Numbering, read_body, read_pose, read_shape, write_body, write_shape
from expert.files.section import Section
from expert.geometry.polygon import mass_properties
from expert.world.shape import Shape
from tests.support.polygons import random_polygon
from tests.support.same import assert_same

SQUARE = [[0, 0], [2, 0], [2, 2], [0, 2]]
LEFT, RIGHT = [[0, 0], [1, 0], [1, 2], [0, 2]], [[1, 0], [2, 0], [2, 2], [1, 2]]


def shape(**data: Any) -> Shape:
    return read_shape(Section(data, "object", ("vertices", "pieces")))


def body(**data: Any) -> Any:
    return read_body(Section(data, "object", ("vertices", "mass", "com", "inertia")))


def test_a_shape_of_vertices_of_pieces_or_of_both() -> None:
    assert_same(shape(vertices=SQUARE[::-1]).vertices, np.array([SQUARE[-1], *SQUARE[:-1]], dtype=float))
    both = shape(vertices=SQUARE, pieces=[LEFT, RIGHT])
    assert [len(p) for p in both.pieces] == [4, 4]
    assert len(shape(pieces=[LEFT, RIGHT]).vertices) == 4
    assert_same(shape(**write_shape(both)), both)


@pytest.mark.parametrize(
    ("data", "complaint"),
    [
        ({"vertices": [[0, 0], [1e-12, 0], [0, 1e-12]]}, "object.vertices: expected a polygon larger"),
        ({"pieces": [[[0, 0], [1e-12, 0], [0, 1e-12]]]}, r"object.pieces\[0\]: expected a polygon larger"),
        ({"pieces": 3}, "object.pieces: expected a list of convex polygons, got 3"),
        ({}, "object.vertices: .* nothing"),
    ],
)
def test_what_is_no_shape_is_refused(data: dict[str, Any], complaint: str) -> None:
    with pytest.raises(InvalidProblem, match=f"^{complaint}"):
        shape(**data)


def test_a_body_lies_about_its_centre_of_mass_and_is_written_so() -> None:
    plate = mass_properties(np.array(SQUARE, dtype=float))
    uniform, com = body(vertices=SQUARE, mass=3.0)
    np.testing.assert_allclose(com, [1, 1])
    assert uniform.inertia == pytest.approx(3 * plate.second_moment / plate.area)
    moved, com = body(vertices=SQUARE, mass=3.0, com=[0.5, 1])
    np.testing.assert_allclose(moved.vertices, np.array(SQUARE) - [0.5, 1])
    assert moved.inertia == pytest.approx(uniform.inertia + 3 * 0.5**2)
    assert body(vertices=SQUARE, mass=3.0, inertia=7.0)[0].inertia == 7
    assert_same(body(**write_body(moved))[0], moved)
    with pytest.raises(InvalidProblem, match=r"object.com: .* inside"):
        body(vertices=SQUARE, mass=3.0, com=[2.5, 1])


def test_the_pose_is_the_origin_where_none_is_stated() -> None:
    assert_same(read_pose(Section({}, "", ("pose",))), np.zeros(3))
    assert_same(read_pose(Section({"pose": [1, 2, 3]}, "", ("pose",))), np.array([1.0, 2, 3]))


@given(st.integers(0, 10**6), st.booleans())
def test_numbers_name_the_same_facets_and_vertices_in_both_lists(seed: int, backwards: bool) -> None:
    listed = random_polygon(np.random.default_rng(seed), 6)[:: -1 if backwards else 1]
    inside, numbering = (
        Shape(vertices=listed).vertices,
        Numbering.of({"object": {"vertices": listed.tolist()}}),
    )
    assert numbering.clockwise == backwards
    n = len(listed)
    facets = numbering.facets(np.arange(n))
    for k in range(n):
        np.testing.assert_array_equal(inside[numbering.vertex(k)], listed[k])
        ends = {tuple(inside[facets[k]]), tuple(inside[(facets[k] + 1) % n])}
        assert ends == {tuple(listed[k]), tuple(listed[(k + 1) % n])}
    np.testing.assert_array_equal(numbering.facets(np.array([-1, *facets])), [-1, *range(n)])
