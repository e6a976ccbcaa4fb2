"""The cage verifier against cages and non-cages by construction, a random refuter, and itself on altered arrangements."""

import numpy as np
import pytest
import shapely

from expert.geometry.pose import Array, rotation, to_world
from expert.problems.cage import Arrangement
from expert.verify.cage.check import verify_cage
from expert.verify.cage.escape import escape_fault
from expert.world.named import named_shape
from expert.world.shape import Shape
from expert.world.walls import segments
from tests.support.arrangements import random_arrangement, transformed, with_finger
from tests.support.refuter import random_escape

SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


def among(vertices: Array, fingers: object, *, pose: object = (0, 0, 0), walls: object = ()) -> Arrangement:
    return Arrangement(
        shape=Shape(vertices=vertices),
        pose=np.array(pose, dtype=float),
        fingers=np.array(fingers, dtype=float),
        walls=segments(walls),
    )


def box_of_walls(half: float, gap: float = 0.0) -> list:
    """Four walls; the right one is open above `half - gap`."""
    c = np.array([[-half, -half], [half, -half], [half, half], [-half, half]])
    return [(c[0], c[1]), (c[1], [half, half - gap]), (c[2], c[3]), (c[3], c[0])]


FAR = [[30.0, 30.0], [30.0, -30.0]]
"""Two fingers that take no part."""


@pytest.mark.parametrize("name", ["I", "hourglass"])
def test_two_fingers_in_the_waist_cage(name: str) -> None:
    report = verify_cage(among(named_shape(name), [[-0.02, 0], [0.02, 0]]))
    assert report.verdict == "caged"
    low, high = report.rotation_range or (np.nan, np.nan)
    assert -np.pi / 2 < low < 0 < high < np.pi / 2
    assert low == pytest.approx(-high)  # both object and fingers are mirror images of themselves


def test_two_fingers_cannot_cage_a_square() -> None:
    report = verify_cage(among(SQUARE, [[-1.01, 0], [1.01, 0]]))
    assert report.verdict == "escapes"
    assert len(report.path) >= 2


def test_four_fingers_against_the_edges_cage_a_square_and_three_do_not() -> None:
    fingers = [[1.02, 0.5], [-0.5, 1.02], [-1.02, -0.5], [0.5, -1.02]]
    assert verify_cage(among(SQUARE, fingers)).verdict == "caged"
    assert verify_cage(among(SQUARE, fingers[:3])).verdict == "escapes"


def test_fingers_that_touch_still_cage() -> None:
    fingers = [[1.0, 0.5], [-0.5, 1.0], [-1.0, -0.5], [0.5, -1.0]]
    assert verify_cage(among(SQUARE, fingers)).verdict == "caged"


def test_a_dense_fence_cages_at_any_orientation() -> None:
    angles = 2 * np.pi * np.arange(12) / 12
    report = verify_cage(among(SQUARE, 1.6 * np.column_stack([np.cos(angles), np.sin(angles)])))
    assert report.verdict == "caged"
    assert report.rotation_range == (-np.inf, np.inf)


@pytest.mark.parametrize(("gap", "verdict"), [(0.0, "caged"), (1.9, "caged"), (2.1, "escapes")])
def test_a_square_leaves_a_box_through_a_gap_wider_than_itself(gap: float, verdict: str) -> None:
    # Turned, a square is never narrower than its side: the slit decides.
    report = verify_cage(among(SQUARE, FAR, walls=box_of_walls(1.6, gap)))
    assert report.verdict == verdict


@pytest.mark.parametrize(("play", "verdict"), [(-0.004, "caged"), (0.004, "escapes")])
def test_the_critical_opening_of_a_slot_is_found(play: float, verdict: str) -> None:
    """A bar of thickness 0.2 leaves a box only through a hole of its own thickness."""
    bar = np.array([[-1.0, -0.1], [1.0, -0.1], [1.0, 0.1], [-1.0, 0.1]])
    hole = 0.2 + play
    walls = [
        ([-1.2, -1.2], [1.2, -1.2]), ([-1.2, 1.2], [1.2, 1.2]), ([-1.2, -1.2], [-1.2, 1.2]),
        ([1.2, -1.2], [1.2, -hole / 2]), ([1.2, hole / 2], [1.2, 1.2]),
    ]  # fmt: skip
    assert verify_cage(among(bar, FAR, walls=walls)).verdict == verdict


def test_a_start_pose_inside_one_of_two_chambers_matters() -> None:
    chambers = [*box_of_walls(1.6), ([1.6, -1.6], [8.0, -1.6])]
    assert verify_cage(among(SQUARE, FAR, walls=chambers)).verdict == "caged"
    assert verify_cage(among(SQUARE, FAR, pose=(4, 0, 0), walls=chambers)).verdict == "escapes"


def test_the_rotation_range_of_a_bar_between_walls_is_located() -> None:
    """A bar of length 2 and thickness 0.2 in a channel of width 0.6, closed at its ends."""
    bar = np.array([[-1.0, -0.1], [1.0, -0.1], [1.0, 0.1], [-1.0, 0.1]])
    corners = [[-1.05, -0.3], [1.05, -0.3], [1.05, 0.3], [-1.05, 0.3]]
    walls = [(corners[k], corners[(k + 1) % 4]) for k in range(4)]
    report = verify_cage(among(bar, FAR, walls=walls))
    # It jams where its height 2 sin t + 0.2 cos t reaches 0.6.
    angles = np.radians(np.linspace(0, 45, 45001))
    limit = float(angles[np.argmax(2 * np.sin(angles) + 0.2 * np.cos(angles) >= 0.6)])
    assert report.verdict == "caged"
    low, high = report.rotation_range or (np.nan, np.nan)
    assert limit <= high <= limit + np.radians(0.6)
    assert low == pytest.approx(-high)


def test_slack_asks_for_a_cage_that_survives_moved_fingers() -> None:
    fingers = np.array([[-0.012, 0], [0.012, 0]])
    hourglass = named_shape("hourglass")
    slack = 0.0005
    assert verify_cage(among(hourglass, fingers), slack=slack).verdict == "caged"
    rng = np.random.default_rng(4)
    for _ in range(5):
        moved = fingers + slack * np.array([rotation(t) @ [1, 0] for t in rng.uniform(0, 7, 2)])
        assert verify_cage(among(hourglass, moved)).verdict == "caged"
    assert verify_cage(among(hourglass, fingers), slack=0.01).verdict != "caged"


def test_a_spent_budget_is_unknown_and_says_how_fine_it_looked() -> None:
    rng = np.random.default_rng(0)
    report = verify_cage(random_arrangement(rng), cell_budget=0)
    assert report.verdict == "unknown"
    assert report.as_dict()["resolution"] == pytest.approx(np.radians(4))


@pytest.mark.parametrize("seed", range(60))
def test_verdicts_contradict_neither_a_refuter_nor_themselves(seed: int) -> None:
    rng = np.random.default_rng([seed, 7])
    arrangement = random_arrangement(rng)
    report = verify_cage(arrangement)
    if report.verdict == "caged":
        assert random_escape(arrangement, rng, nodes=1500) is None
        assert verify_cage(with_finger(arrangement, rng)).verdict == "caged"
    if report.verdict == "escapes":
        assert escape_fault(arrangement, report.path) is None
        assert sampled_depth(arrangement, report.path) <= 2e-7 * arrangement.shape.size
    assert verify_cage(transformed(arrangement, rng)).verdict == report.verdict


def sampled_depth(arrangement: Arrangement, path: Array) -> float:
    """Largest depth [m] of a finger or wall at the poses of a path."""
    obstacles = [*shapely.points(arrangement.fingers), *shapely.linestrings(arrangement.wall_ends)]
    depth = 0.0
    for pose in path:
        polygon = shapely.Polygon(to_world(pose, arrangement.shape.vertices))
        inside = shapely.intersection(polygon, obstacles)
        corners = shapely.points(shapely.get_coordinates(inside))
        depth = max(depth, *shapely.distance(polygon.exterior, corners), 0.0)
    return depth


def test_the_refuter_finds_easy_escapes() -> None:
    rng = np.random.default_rng(0)
    escapes = [a for a in (random_arrangement(rng) for _ in range(40)) if verify_cage(a).verdict == "escapes"]
    found = sum(random_escape(a, rng) is not None for a in escapes)
    assert found >= 0.8 * len(escapes) > 10
