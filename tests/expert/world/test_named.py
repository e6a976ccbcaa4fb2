"""The objects that have names."""

import numpy as np
import pytest

from expert.geometry.polygon import signed_area
from expert.world.named import NAMES, named_shape
from expert.world.shape import Shape


@pytest.mark.parametrize("name", NAMES)
def test_named_shapes_are_simple_counter_clockwise_polygons_of_ten_centimetres(name: str) -> None:
    vertices = named_shape(name)
    shape = Shape(vertices=vertices)
    np.testing.assert_array_equal(shape.vertices, vertices)
    assert signed_area(vertices) > 0
    assert 0.08 < shape.size < 0.16
    assert len(shape.pieces) >= 2  # all of them have pockets


def test_other_names_are_not_known() -> None:
    with pytest.raises(KeyError):
        named_shape("Ω")
