"""Which features touch, against shapely-free geometry that shares no code with the kernels."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from datasets.shapes import Shapes, sample_polygon
from dlm.simulator import SceneBatch, SimulatorSettings
from dlm.simulator.contact import CONTACT, FACET, WALL, Moment, activation, collect, nearest
from dlm.simulator.world import World, world_of
from expert.geometry.polygon import signed_distance
from expert.geometry.pose import rotation
from expert.world.shape import Body
from tests.support.scenes import T, scene

U_SHAPE = np.array([[0, 0], [6, 0], [6, 4], [4, 4], [4, 2], [2, 2], [2, 4], [0, 4]]) * 0.01
REST = np.zeros(3)


def world(vertices) -> World:
    body = Body(vertices=vertices, mass=0.1, inertia=1e-4)
    return world_of(SceneBatch.of([scene(body, np.zeros((T, 3)))]).arrays, 0, SimulatorSettings().numbers)


def contacts_at(vertices, finger, pose=REST):
    out, fingers = np.zeros(20, CONTACT), np.array([finger], dtype=float)
    now = Moment(pose, np.cos(pose[2]), np.sin(pose[2]), np.zeros(3), fingers, np.zeros((1, 2)))
    return out[: collect(world(vertices), now, out)]


@settings(deadline=None)
@given(st.integers(0, 10_000), st.integers(3, 12), st.tuples(*[st.floats(-0.1, 0.1)] * 2))
def test_signed_distance_agrees_with_the_geometry_package(seed, facets, point):
    shapes = Shapes(facets=(facets, facets), shortest_facet=0.2, deepest_dent=1.0, slightest_turn=0.05)
    vertices = sample_polygon(np.random.default_rng(seed), shapes)
    _, _, distance = nearest(world(vertices).facets, *point)
    assert distance == pytest.approx(float(signed_distance(vertices, np.array(point))), abs=1e-12)


def test_a_finger_in_a_concave_corner_touches_both_facets():
    corner = contacts_at(U_SHAPE, [0.0201, 0.0201])
    touching = corner[corner["wall"] < 0]
    assert sorted(touching["feature"]) == [4, 5]
    assert (touching["kind"] == FACET).all()
    normals = sorted(map(tuple, np.column_stack([touching["nx"], touching["ny"]]).round(12)))
    assert normals == [(-1.0, 0.0), (0.0, -1.0)]


def test_contact_gap_is_distance_less_radius_and_force_points_inwards():
    (contact,) = (c for c in contacts_at(U_SHAPE, [0.01, 0.0405]) if c["wall"] < 0)
    assert contact["gap"] == pytest.approx(0.0005 - SimulatorSettings().finger_radius)
    assert (contact["nx"], contact["ny"]) == pytest.approx((0, -1))
    assert (contact["x"], contact["y"]) == pytest.approx((0.01, 0.04))


def test_far_fingers_and_high_vertices_are_left_out():
    contacts = contacts_at(U_SHAPE, [0.5, 0.5])
    assert (contacts["kind"] == WALL).all()
    assert sorted(contacts["feature"]) == [0, 1]


def test_the_lower_hull_of_the_near_vertices_touches_a_wall():
    angles = 2 * np.pi * np.arange(12) / 12
    ring = 1e-4 * np.column_stack([np.cos(angles), np.sin(angles)])  # all twelve within reach of the floor
    contacts = contacts_at(ring, [0.5, 0.5], np.array([0, 1e-4, 0]))
    assert sorted(contacts["feature"]) == [0, 6, 7, 8, 9, 10, 11]


def test_of_vertices_on_a_line_the_ends_touch_a_wall():
    cut = np.column_stack([np.linspace(0, 0.06, 14), np.zeros(14)])
    vertices = np.vstack([cut, [[0.06, 0.04], [0, 0.04]]])
    for angle, ends in ((0, [0, 13]), (0.003, [0, 13]), (-0.02, [0, 13]), (0.1, [0, 4])):
        pose = np.array([0, -(rotation(angle) @ vertices.T)[1].min(), angle])
        assert sorted(contacts_at(vertices, [0.5, 0.5], pose)["feature"]) == ends


def test_activation_is_one_in_contact_and_tends_to_the_rigid_law():
    assert activation(-1e-3, 100.0) == activation(0.0, 100.0) == 1
    assert activation(1e-3, 100.0) == pytest.approx(2 / (1 + np.exp(0.1)))
    assert activation(1e-3, 1e5) < 1e-40
    assert activation(1e-3, np.inf) < 1e-200
    assert np.isfinite(activation(1e300, 1e300))
