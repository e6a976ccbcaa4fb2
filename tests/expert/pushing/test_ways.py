"""Stand-off curve, roads and travel."""

import numpy as np
import pytest
import shapely

from expert.geometry.pose import to_world
from expert.pushing.approach import Travel
from expert.pushing.contour import contour
from expert.pushing.drive import Drive
from expert.pushing.outline import clearance, outline
from expert.pushing.planner import box
from expert.pushing.roads import bends, distances, roads
from tests.support.pushing import TEE

ORIGIN = np.array([0.0, 45.0])
EDGES = outline(TEE, ORIGIN)
CURVE = contour(TEE, ORIGIN, 21.0)
STATIONS, _ = CURVE.at(np.arange(40) * CURVE.length / 40)
WAYS = roads(TEE, ORIGIN, 15.0, 6.0, STATIONS)


def way(point):
    lengths, first = np.empty(len(STATIONS)), np.empty(len(STATIONS), np.int64)
    distances(WAYS, *point, lengths, first)
    return lengths


def test_stations_keep_their_gap_and_face_the_object():
    points, normals = CURVE.at(np.linspace(0, CURVE.length, 200, endpoint=False))
    gaps = np.array([clearance(EDGES, *p) for p in points])
    assert gaps == pytest.approx(21, abs=0.15)  # arcs are chords
    nearer = np.array([clearance(EDGES, *p) for p in points + normals])
    assert ((gaps - nearer) > 0.5).all()


def test_ways_are_as_long_as_the_legs_between_their_bends_and_cut_no_corner():
    solid = shapely.buffer(shapely.Polygon(TEE.vertices - ORIGIN), 0.74 * 15)
    rng = np.random.default_rng(1)
    for _ in range(20):
        point = STATIONS[rng.integers(40)] + rng.normal(size=2)
        lengths = way(point)
        for station in range(0, 40, 3):
            line = shapely.LineString([point, *bends(WAYS, point, station), STATIONS[station]])
            assert lengths[station] == pytest.approx(line.length)
            assert not line.crosses(solid)


def test_the_shortest_way_is_not_beaten_by_a_walk_round_either_side():
    lengths = way(STATIONS[0])
    one_way = np.arange(40) * CURVE.length / 40
    round_corners = 6 * 21 * (2 - np.pi / 2)  # ways bend at mitred corners, outside the curve's arcs
    assert (lengths <= np.minimum(one_way, CURVE.length - one_way) + round_corners).all()
    assert (lengths >= np.linalg.norm(STATIONS - STATIONS[0], axis=1) - 1e-9).all()


def test_travel_ends_at_rest_beside_the_object_and_keeps_its_gap():
    travel = Travel(Drive(), EDGES, WAYS, 2.0, box(0, 512))
    pose = np.array([250.0, 260.0, 0.7])
    stations = to_world(pose, STATIONS)
    for a, b in [(0, 20), (5, 30), (12, 13), (33, 8)]:
        commands = travel.commands(pose, stations[b], stations[a], np.zeros(2))
        assert commands is not None
        assert (commands >= 0).all()
        assert (commands <= 512).all()
        position, velocity = stations[a], np.zeros(2)
        for command in commands:
            for _ in range(10):
                velocity = velocity + 0.01 * (100 * (command - position) - 20 * velocity)
                position = position + 0.01 * velocity
                body = shapely.Polygon(to_world(pose, TEE.vertices - ORIGIN))
                assert body.distance(shapely.Point(position)) >= 17 - 1e-6
        assert position == pytest.approx(stations[b], abs=1e-6)
        assert velocity == pytest.approx([0, 0], abs=1e-5)


def test_no_travel_where_commands_would_leave_the_workspace():
    pose = np.array([250.0, 260.0, 0.7])
    stations = to_world(pose, STATIONS)
    travel = Travel(Drive(), EDGES, WAYS, 2.0, box(240, 260))
    assert travel.commands(pose, stations[20], stations[0], np.zeros(2)) is None
