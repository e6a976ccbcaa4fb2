"""Each block of the loop admits exactly the choices that its equation does, decided a second time with polygons."""

import itertools

import numpy as np
import pytest
import shapely

from expert.geometry.convex import Region
from expert.geometry.cover import half_planes
from expert.geometry.pose import Array
from expert.loops import blocks
from expert.mip.affine import Affine
from expert.mip.linear import LinearModel

SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
TRIANGLE = np.array([[0.0, 0.0], [1.5, 0.2], [0.3, 1.0]])
SETS = [half_planes(SQUARE), half_planes(TRIANGLE + [0.8, 0.8])]


def can_be(model: LinearModel, *fixed: tuple[Affine, Array]) -> bool:
    """Whether the model has a solution in which these variables have these values."""
    for variables, value in fixed:
        model.add(variables == value)
    status = model.solve().status
    assert status in ("optimal", "infeasible")
    return status == "optimal"


def one_hot(*ones: int, of: int) -> Array:
    return np.eye(of)[list(ones)]


def test_a_finger_is_in_the_region_that_it_chose() -> None:
    rng = np.random.default_rng(0)
    answers = []
    for _ in range(40):
        p, choice = rng.uniform(-1.2, 1.7, (1, 2)), int(rng.integers(2))
        model = LinearModel()
        P, R = model.variables((1, 2), -4, 4), model.binaries(1, 2)
        blocks.non_penetration(model, P, R, [Region(A, b) for A, b in SETS])
        expected = bool((SETS[choice][0] @ p[0] <= SETS[choice][1]).all())
        assert can_be(model, (P, p), (R, one_hot(choice, of=2))) == expected
        answers.append(expected)
    assert 5 < sum(answers) < 35


def test_neighbours_are_apart_by_a_difference_in_the_set_that_they_chose_but_not_along_a_wall() -> None:
    rng = np.random.default_rng(1)
    answers = []
    for k in range(60):
        p, choice, apart = rng.uniform(-1, 1, (2, 2)), rng.integers(2, size=2), np.array([True, k % 2 == 0])
        model = LinearModel()
        P, H = model.variables((2, 2), -4, 4), model.binaries(2, 2)
        blocks.intersections(model, P, H, SETS, apart)
        gaps = p - p[::-1]
        expected = all(
            (SETS[c][0] @ gap <= SETS[c][1]).all() or not differs
            for gap, c, differs in zip(gaps, choice, apart, strict=True)
        )
        assert can_be(model, (P, p), (H, one_hot(*choice, of=2))) == expected
        answers.append(expected)
    assert 5 < sum(answers) < 55


def test_the_loop_leaves_and_enters_each_finger_by_the_pieces_of_its_pair() -> None:
    """All ways of two fingers through pieces 0 and 1."""
    keys = pairs = list(itertools.product(range(2), repeat=2))
    allowed = 0
    for meetings in itertools.product(range(4), repeat=2):
        for inner in itertools.product(range(4), repeat=2):
            model = LinearModel()
            H, W = model.binaries(2, 4), model.variables((2, 1, 4), 0, 1)
            blocks.loop_closure(model, H, keys, W, pairs)
            leaves = [keys[k][0] for k in meetings]
            enters_next = [keys[k][1] for k in meetings]
            expected = all(
                pairs[inner[n]] == (enters_next[1 - n], leaves[n]) for n in range(2)
            )  # entry from the other finger, exit towards it
            chosen = one_hot(*inner, of=4)[:, None]
            assert can_be(model, (H, one_hot(*meetings, of=4)), (W, chosen)) == expected
            allowed += expected
    assert allowed == 16


@pytest.mark.parametrize("turns", [-1, 0, 1, 2])
def test_only_loops_that_wind_once_pass(turns: int) -> None:
    """Four elements seen in directions that go round `turns` times, each lifted by any full turn."""
    rng = np.random.default_rng(2)
    for _ in range(5):
        seen = 2 * np.pi * turns * np.arange(4) / 4 + rng.uniform(-0.3, 0.3, 4)
        directions = (seen + 2 * np.pi * rng.integers(-1, 1, 4))[:, None]  # region r of element r, one piece
        model = LinearModel()
        W = model.variables((4, 4, 1), 0, 1)
        blocks.object_enclosing(model, W, [(0, 0)], directions)
        assert can_be(model, (W, np.eye(4)[..., None])) == (turns == 1)


def test_three_fingers_fill_their_loop_where_their_obstacles_have_a_common_point() -> None:
    rng = np.random.default_rng(3)
    common = {(0, 0): SETS[0], (1, 1): SETS[1]}
    shapes = [shapely.Polygon(SQUARE), shapely.Polygon(TRIANGLE + [0.8, 0.8])]
    answers = []
    for _ in range(40):
        p, used = rng.uniform(-1.3, 1.3, (3, 2)), rng.integers(2, size=3)
        model = LinearModel()
        P, W = model.variables((3, 2), -4, 4), model.variables((3, 1, 2), 0, 1)
        blocks.fill(model, P, W, [(0, 0), (1, 1)], 0, common)
        obstacles = [
            shapely.affinity.translate(shapely.affinity.scale(shapes[c], -1, -1, origin=(0, 0)), *x)
            for c, x in zip(used, p, strict=True)
        ]
        expected = not shapely.intersection_all(obstacles).is_empty
        assert can_be(model, (P, p), (W, one_hot(*used, of=2)[:, None])) == expected
        answers.append(expected)
    assert 5 < sum(answers) < 35


@pytest.mark.parametrize(("count", "hub"), [(3, 0), (4, 1), (6, 2)])
def test_fans_share_edges_with_the_loop(count: int, hub: int) -> None:
    corners = [[c for c, _ in triangle] for triangle in blocks.triangles(count, hub)]
    assert len(corners) == count - 2
    edges = {frozenset((a, b)) for t in corners for a in t for b in t if a != b}
    assert all(frozenset((k, (k + 1) % count)) in edges for k in range(count))


def test_two_fingers_cut_their_loop_along_one_piece_of_each() -> None:
    assert blocks.triangles(2, 0) == [[(0, "both"), (1, "exit")], [(1, "both"), (0, "exit")]]
    assert blocks.triangles(2, 1) == [[(0, "both"), (1, "entry")], [(1, "both"), (0, "entry")]]
