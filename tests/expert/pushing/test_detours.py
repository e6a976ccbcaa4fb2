import numpy as np
import pytest
import shapely

from expert.pushing.detours import Detours, lengths_to
from expert.world.walls import Obstacle
from tests.support.pushes import square_problem

WALL = Obstacle(vertices=[[0.07, -0.15], [0.09, -0.15], [0.09, 0.05], [0.07, 0.05]])
SPACE = np.array([-0.3, -0.3, 0.4, 0.3])


def problem(**changes):
    return square_problem(goal=np.array([0.2, 0, 0]), obstacles=(WALL,), workspace=SPACE, **changes)


def test_ways_keep_clear_of_object_and_obstacles():
    made = problem()
    solid = shapely.Polygon(WALL.vertices) | shapely.Polygon(made.outline(made.start))
    found = 0
    for start, end in np.random.default_rng(0).uniform(-0.28, 0.28, (60, 2, 2)):
        if min(solid.distance(shapely.Point(p)) for p in (start, end)) < 0.0121:
            continue
        way = Detours(made).way(made.start, start, end)
        assert way is not None
        line = shapely.LineString(np.concatenate([start[None], way]))
        assert line.distance(solid) > 0.0119
        assert (way[-1] == end).all()
        assert line.length < 1.2
        found += 1
    assert found > 20


def test_a_free_way_is_straight():
    way = Detours(problem()).way(np.zeros(3), np.array([-0.2, 0.2]), np.array([0.2, 0.2]))
    assert way == pytest.approx(np.array([[0.2, 0.2]]))


def test_a_finger_that_touches_first_leaves_straight_off():
    way = Detours(problem()).way(np.zeros(3), np.array([-0.05, 0.01]), np.array([0.2, -0.2]))
    assert way is not None
    assert way[0] == pytest.approx([-0.0524, 0.01])


def test_there_is_no_way_into_what_is_closed():
    box = [[0.1, 0.1], [0.3, 0.1], [0.3, 0.29], [0.28, 0.29], [0.28, 0.12], [0.1, 0.12]]
    lid = [[0.08, 0.1], [0.1, 0.1], [0.1, 0.29], [0.3, 0.29], [0.3, 0.3], [0.08, 0.3]]
    made = square_problem(obstacles=(Obstacle(vertices=box), Obstacle(vertices=lid)), workspace=SPACE)
    assert Detours(made).way(made.start, np.array([-0.2, 0]), np.array([0.2, 0.2])) is None


def test_lengths_of_ways_go_round_obstacles_and_never_exceed_the_shortest_by_much():
    made = problem()
    goal = np.array([0.2, 0.0])
    lengths, low, cell = lengths_to(made, goal, 70)
    rows, columns = lengths.shape
    nodes = low + cell * np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), -1)
    straight = np.linalg.norm(nodes - goal, axis=-1)
    reached = np.isfinite(lengths)
    assert (lengths[reached] >= straight[reached] - 2 * cell).all()
    row, column = np.rint((np.array([0.0, 0.0]) - low) / cell).astype(int)[::-1]
    round_the_top = 2 * np.hypot(0.1, 0.09)
    assert lengths[row, column] == pytest.approx(round_the_top, rel=0.12)
    assert not reached[np.rint((np.array([0.0, 0.08]) - low) / cell).astype(int)[::-1][0], :].all()


def test_what_obstacles_part_is_infinitely_far():
    wall = Obstacle(vertices=[[0.07, -0.3], [0.09, -0.3], [0.09, 0.3], [0.07, 0.3]])
    made = square_problem(goal=np.array([0.2, 0, 0]), obstacles=(wall,), workspace=SPACE)
    lengths, low, cell = lengths_to(made, np.array([0.2, 0.0]), 60)
    row, column = np.rint(-low / cell).astype(int)[::-1]
    assert lengths[row, column] == np.inf
