"""The exact path check: what it must refuse, what it must accept, and its primitives against plain sampling."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from expert.geometry.pose import Array, rotation
from expert.problems.cage import Arrangement
from expert.verify.cage.check import verify_cage
from expert.verify.cage.escape import arc_meets_segment, drawn_in, escape_fault, segments_meet
from expert.world.shape import Shape
from expert.world.walls import segments

SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
NONE = np.empty((0, 2, 2))


def arrangement(fingers: object, walls: object = NONE) -> Arrangement:
    return Arrangement(
        shape=Shape(vertices=SQUARE),
        pose=np.zeros(3),
        fingers=np.array(fingers, dtype=float),
        walls=segments(walls),
    )


PAIR = arrangement([[1.5, 0], [-1.5, 0]])
WALLED = arrangement([[9, 9], [9, -9]], [[[1.2, -5], [1.2, 0.5]]])


def test_a_clear_way_out_is_accepted() -> None:
    assert escape_fault(PAIR, np.array([[0, 0, 0], [0, 3, 0]])) is None


@pytest.mark.parametrize(
    ("scene", "path", "fault"),
    [
        (PAIR, [[0, 0.1, 0], [0, 3, 0]], "start pose"),
        (PAIR, [[0, 0, 0], [3, 0, 0]], "move 0 collides"),
        (PAIR, [[0, 0, 0], [20, 0, 0]], "move 0 collides"),  # both ends free, a finger in between
        (PAIR, [[0, 0, 0], [0, 0.1, 0]], "still among"),
        (PAIR, [[0, 0, 0], [0, 0, 3.1], [0, 3, 3.1]], "turns by more"),
        (arrangement([[1.2, 0], [-1.2, 0]]), [[0, 0, 0], [0, 0, np.pi / 2], [0, 3, np.pi / 2]], "move 0"),
        (PAIR, [[0, 0, 0], [0, np.nan, 0]], "no poses"),
        (PAIR, np.empty((0, 3)), "no poses"),
        # A wall's interior passes between two corners: neither of its ends touches the square.
        (WALLED, [[0, 0, 0], [20, 0, 0]], "move 0 collides"),
        (WALLED, [[0, 0, 0], [0, 0, 0.3], [0, 20, 0.3]], "move 0 collides"),
    ],
)
def test_faults_are_named(scene: Arrangement, path: object, fault: str) -> None:
    assert fault in (escape_fault(scene, np.array(path, dtype=float)) or "accepted")


def test_turning_in_place_where_there_is_room_is_accepted() -> None:
    path = np.array([[0, 0, 0], [0, 0, np.pi / 2], [0, 3, np.pi / 2]])
    assert escape_fault(PAIR, path) is None


def test_a_turn_about_a_distant_point_follows_its_arc() -> None:
    # Half a turn about (0, 3): the square passes left of the finger at (0, 3) that the chord would run over.
    scene = arrangement([[0, 3.0], [0, 3.2]])
    turn = np.array([[0, 0, 0], [-3, 3, -np.pi / 2], [0, 6, -np.pi], [0, 9, -np.pi]])
    assert escape_fault(scene, turn) is None
    assert escape_fault(scene, np.array([[0, 0, 0], [0, 9, 0]])) == "move 0 collides"


points = st.tuples(st.floats(-2, 2), st.floats(-2, 2)).map(np.array)


@settings(max_examples=200, deadline=None)
@given(points, points, points, points)
def test_segments_meet_agrees_with_the_distance_between_them(p: Array, q: Array, a: Array, b: Array) -> None:
    s = np.linspace(0, 1, 400)[:, None]
    near = np.linalg.norm((p + s * (q - p))[:, None] - (a + s * (b - a))[None], axis=2).min()
    if near > 0.02:  # farther apart than the samples are
        assert not segments_meet(p, q, a, b)
    if segments_meet(p, q, a, b):
        assert near <= 0.02


@settings(max_examples=200, deadline=None)
@given(points, points, st.floats(-3, 3), points, points)
def test_arcs_meet_segments_where_sampled_arcs_do(
    p: Array, pole: Array, angle: float, a: Array, b: Array
) -> None:
    turns = np.linspace(0, angle, 600)
    arc = pole + (rotation(turns) @ (p - pole)[:, None])[..., 0]
    side = (b - a)[0] * (arc - a)[:, 1] - (b - a)[1] * (arc - a)[:, 0]
    along = (arc - a) @ (b - a) / max(float((b - a) @ (b - a)), 1e-300)
    crosses = (side[1:] * side[:-1] < 0) & (along[1:] > 0.01) & (along[1:] < 0.99)
    if np.linalg.norm(b - a) > 0.05 and crosses.any():
        assert arc_meets_segment(p, pole, angle, a, b)
    nearest = np.clip(along, 0, 1)[:, None] * (b - a) + a
    if np.linalg.norm(arc - nearest, axis=1).min() > 0.05 and np.linalg.norm(b - a) > 0.05:
        assert not arc_meets_segment(p, pole, angle, a, b)


def test_a_needle_is_no_hole() -> None:
    """1 m by 10 nm, held by fingers that touch its ends and sides: thinner than the depth to which starts may be entered."""
    half = 5e-9
    needle = np.array([[-0.5, -half], [0.5, -half], [0.5, half], [-0.5, half]])
    fingers = np.array([[-0.5, 0], [0.5, 0], [-0.3, half], [-0.3, -half], [0.3, half], [0.3, -half]])
    scene = Arrangement(shape=Shape(vertices=needle), pose=np.zeros(3), fingers=fingers)
    assert escape_fault(scene, np.array([[0, 0, 0], [0, 1, 0]], dtype=float)) is not None
    assert verify_cage(scene).verdict == "unknown"


def test_a_needle_that_leaves_along_itself_escapes() -> None:
    needle = np.array([[-0.5, -5e-9], [0.5, -5e-9], [0.5, 5e-9], [-0.5, 5e-9]])
    fingers = np.array([[-0.3, 0.001], [-0.3, -0.001], [0.3, 0.001], [0.3, -0.001]])
    scene = Arrangement(shape=Shape(vertices=needle), pose=np.zeros(3), fingers=fingers)
    assert escape_fault(scene, np.array([[0, 0, 0], [2, 0, 0]], dtype=float)) is None
    assert escape_fault(scene, np.array([[0, 0, 0], [0, 2, 0]], dtype=float)) == "move 0 collides"


def test_drawing_in_keeps_every_corner_or_says_so() -> None:
    assert drawn_in(SQUARE, 1e-7, 1e-6).area == pytest.approx((2 - 2e-7) ** 2, rel=1e-12)
    wedge = np.array([[0, -0.01], [1, 0], [0, 0.01]])  # its tip recedes by a hundred times the depth
    assert drawn_in(wedge, 1e-7, 1e-6) is None
    assert drawn_in(wedge, 1e-9, 1e-6) is not None
    dumbbell = np.array([[-1, -1], [0, -1e-8], [1, -1], [1, 1], [0, 1e-8], [-1, 1]])
    assert drawn_in(dumbbell, 1e-7, 1e-6) is None
