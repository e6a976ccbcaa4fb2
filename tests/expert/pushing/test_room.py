import numpy as np
import pytest
import shapely

from expert.geometry.pose import to_world
from expert.pushing.outline import outline
from expert.pushing.room import EVERYWHERE, NOTHING, Field, Room, finger_fits, fits, way_round
from tests.support.pushes import SQUARE, TEE

WALLS = np.array([[1.0, 0, -0.2], [0, 1, -0.2], [-1, 0, -0.2], [0, -1, -0.2]])


def room(obstacles=NOTHING, gap=0.0) -> Room:
    pieces = outline(TEE, np.zeros(2))
    return Room(TEE.vertices, WALLS, WALLS, pieces, obstacles, gap, 0.01, EVERYWHERE)


def test_an_object_fits_where_it_overlaps_no_obstacle_and_no_wall():
    """Pieces may be apart by the gap although no edge shows it: then the answer is no, but only near the gap."""
    space, solid = room(outline(SQUARE, np.zeros(2)), gap=0.003), shapely.Polygon(SQUARE.vertices)
    rng, seen = np.random.default_rng(0), set()
    for pose in rng.uniform([-0.2, -0.2, -4], [0.2, 0.2, 4], (300, 3)):
        body = to_world(pose, TEE.vertices)
        distance = shapely.Polygon(body).distance(solid)
        inside = np.abs(body).max() <= 0.2
        found = fits(space, *pose, 0.0)
        if distance < 0.003 or not inside:
            assert not found
        elif distance > 0.003 * np.sqrt(2) + 1e-9:
            assert found
        seen.add(bool(found))
    assert seen == {True, False}


def test_a_finger_keeps_its_gap():
    space = room(outline(SQUARE, np.zeros(2)))
    assert finger_fits(space, 0.0501, 0)
    assert not finger_fits(space, 0.0499, 0)
    assert not finger_fits(space, 0.21, 0)
    assert finger_fits(room(), 0, 0)


def test_the_way_round_is_read_at_the_nearest_node():
    field = Field(np.array([[3.0, 2.0], [np.inf, 1.0]]), x=1.0, y=2.0, cell=0.5)
    assert way_round(field, 1.2, 2.1) == 3.0
    assert way_round(field, 1.3, 2.3) == 1.0
    assert way_round(field, -9.0, 9.0) == np.inf
    assert way_round(EVERYWHERE, 5.0, 5.0) == pytest.approx(0.0)
