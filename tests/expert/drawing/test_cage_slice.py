"""A slice of configuration space: obstacles, the free part about the start, and a closed curve around it."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from expert.drawing.cage_slice import draw_slice, enclosing_loop
from expert.drawing.canvas import new_figure
from expert.drawing.marks import FREE
from expert.geometry.polygon import facet_frames, facets
from expert.geometry.pose import to_world
from expert.problems.cage import Arrangement
from expert.world.named import named_shape
from expert.world.shape import Shape
from expert.world.slices import free_components, obstacles_at
from tests.support.pictures import coloured, shown_at, texts
from tests.support.polygons import random_polygon


def test_free_positions_are_blue_and_obstacles_bear_the_numbers_of_their_fingers() -> None:
    cage = Arrangement(
        shape=Shape(vertices=named_shape("I")), pose=np.zeros(3), fingers=np.array([[-0.03, 0], [0.03, 0]])
    )
    figure = new_figure(4, 4)
    axes = figure.add_subplot()
    draw_slice(axes, cage)
    image, places = shown_at(
        figure, axes, np.array([[0.005, 0.005], [-0.005, -0.005], [0.03, 0.0], [0.2, 0]])
    )
    assert list(coloured(image, FREE)[tuple(places[:3].T)]) == [True, True, False]
    assert {"configuration space at θ = 0°", "0", "1"} <= set(texts(figure))
    assert any(word.endswith(" mm") for word in texts(figure))


@given(st.integers(0, 10**6), st.floats(-3, 3))
@settings(max_examples=20, deadline=None, derandomize=True)
def test_the_drawn_loop_stays_in_obstacles_and_winds_once_around_the_start(seed: int, angle: float) -> None:
    """Fingers close to the facets of a polygon leave it little room at its orientation."""
    shape = Shape(vertices=random_polygon(np.random.default_rng(seed), 5))
    a, b = facets(shape.vertices)
    inward, _ = facet_frames(shape.vertices)
    beside = (a + b) / 2 - 0.01 * shape.size * inward
    pose = np.array([0.1, 0.0, angle])
    cage = Arrangement(shape=shape, pose=pose, fingers=to_world(pose, beside))
    obstacles = obstacles_at(cage.shape, cage.fingers, cage.wall_ends, angle)
    (component,) = (
        p
        for p in free_components(cage.shape, cage.fingers, cage.wall_ends, angle)
        if p.covers(shapely.Point(0.1, 0))
    )
    loop = enclosing_loop(component, obstacles)
    assert shapely.union_all(obstacles).buffer(1e-9).covers(shapely.LineString(loop))
    assert shapely.Polygon(loop).area > 1.05 * component.area
    angles = np.unwrap(np.arctan2(*(loop - pose[:2]).T[::-1]))
    assert abs(angles[-1] - angles[0]) == pytest.approx(2 * np.pi)
