"""Each block of MIP1: cages known by construction satisfy it, a binary of one forces its equation, brute force agrees."""

import cvxpy as cp
import numpy as np
import pytest
import shapely

from expert.caging import thesis_blocks as blocks
from expert.caging.thesis import blocks as all_blocks
from expert.caging.thesis import slices
from expert.caging.thesis_blocks import Variables
from expert.caging.thesis_geometry import SlicedObject, limit_contacts
from expert.geometry.cover import clip
from expert.geometry.polygon import facet_frames, reflex_vertices, signed_distance
from expert.geometry.pose import Array, rotation
from expert.mip.block import Block
from expert.mip.solve import solve
from expert.world.frame import Frame
from expert.world.named import named_shape
from expert.world.shape import Shape
from tests.support.polygons import random_nonconvex_polygon, random_polygon

HALF = np.radians(20)
CLEARANCE = 1e-3
HEXAGON = np.array([[np.cos(t), np.sin(t)] for t in np.pi / 3 * np.arange(6)])


def relative(vertices: Array) -> Array:
    return Frame.of(Shape(vertices=vertices), np.zeros(3)).body(vertices)


def sliced(vertices: Array, count: int = 3) -> SlicedObject:
    return SlicedObject.of(vertices, slices(HALF, HALF, 5), CLEARANCE, count)


@pytest.fixture(scope="module")
def o() -> SlicedObject:
    """The T: two overlapping pieces, reflex corners."""
    return sliced(relative(named_shape("T")))


@pytest.fixture
def x(o: SlicedObject) -> Variables:
    return Variables.of(o, 3)


def feasible(*parts: Block | cp.Constraint) -> bool:
    constraints = [c for part in parts for c in (part.constraints if isinstance(part, Block) else [part])]
    result = solve(cp.Problem(cp.Minimize(0), constraints), solver="highs", time_limit=60)
    assert result.status in ("optimal", "infeasible"), result
    return result.status == "optimal"


def largest(expression: cp.Expression, *parts: Block | cp.Constraint) -> float:
    constraints = [c for part in parts for c in (part.constraints if isinstance(part, Block) else [part])]
    result = solve(cp.Problem(cp.Maximize(expression), constraints), solver="highs", gap=1e-9, time_limit=60)
    assert result.status == "optimal", result
    return result.value


def hexagon_cage(turn: float) -> Array:
    """Three fingers that touch facets 0, 2 and 4 of a hexagon when it has turned by +-turn, and are free of it between."""
    angles = np.radians([30, 150, 270])
    return np.sqrt(0.75) / np.cos(turn) * np.column_stack([np.cos(angles), np.sin(angles)])


def test_a_cage_by_construction_satisfies_all_blocks_and_a_wider_one_touches_at_no_slice() -> None:
    hexagon = sliced(HEXAGON)
    x = Variables.of(hexagon, 3)
    *program, _ = all_blocks(x, hexagon)  # without the order of fingers
    assert feasible(*program, x.p == hexagon_cage(HALF))
    assert np.asarray(x.Theta.value).round().tolist() == [1, 0, 0, 0, 1]
    assert feasible(*program, x.p == hexagon_cage(HALF / 2))
    assert np.asarray(x.Theta.value).round().tolist() == [1, 1, 0, 1, 1]
    assert not feasible(*program, x.p == hexagon_cage(0.75 * HALF))


def test_ct1_joins_the_pieces_that_h_names(x: Variables, o: SlicedObject) -> None:
    block = blocks.intersections(x, o)
    chosen = [x.H[0, 0, 1] == 1, cp.sum(x.H[0]) == 1, cp.sum(x.H[2]) == 0, cp.sum(x.G) == 0]
    r, r_next = x.way[0, 0, 2], x.way[1, 1, 0]
    gap = largest(cp.sum(r - r_next), block, *chosen)
    assert gap == pytest.approx(0, abs=1e-7)
    assert largest(cp.sum(x.way[0, 0, 2] - x.way[1, 0, 0]), block, *chosen) > 1
    for normal, b in zip(o.piece_A[1], o.piece_b[1], strict=True):
        assert largest(normal @ (x.p[1] - r_next), block, *chosen) <= b + 1e-7


def test_ct2_wants_one_meeting_with_the_next_finger(x: Variables) -> None:
    block = blocks.one_intersection(x)
    assert not feasible(block, cp.sum(x.H[1]) == 0)
    assert not feasible(block, x.H[1, 0, 0] == 1, x.H[1, 0, 1] == 1)
    assert feasible(block, x.H[1, 0, 1] == 1)


def test_ct3_and_ct4_let_the_loop_go_on_through_pieces_that_meet(x: Variables, o: SlicedObject) -> None:
    block = blocks.loop_closure(x, o)
    assert o.meeting.all()
    comes, one_each = x.H[0, 0, 0] == 1, cp.sum(x.H, axis=(1, 2)) == 1
    straight = [x.H[1, 0, 0] == 1, cp.sum(x.G[1]) == 0]
    assert feasible(block, one_each, comes, *straight)
    assert not feasible(block, one_each, comes, x.H[1, 1, 0] == 1, cp.sum(x.G[1]) == 0)
    assert feasible(block, one_each, comes, x.H[1, 1, 0] == 1, x.G[1, 0, 1] == 1)
    gap = cp.sum(x.way[1, 0, 2] - x.way[1, 1, 0])
    assert largest(gap, block, one_each, x.G[1, 0, 1] == 1) == pytest.approx(0, abs=1e-7)


def test_ct4_refuses_a_way_between_pieces_that_do_not_meet() -> None:
    apart = sliced(relative(named_shape("I")))
    first, second = np.argwhere(~apart.meeting)[0]
    x = Variables.of(apart, 2)
    assert not feasible(blocks.loop_closure(x, apart), x.G[0, first, second] == 1)


def winding(loop: Array) -> int:
    angles = np.arctan2(loop[:, 1], loop[:, 0])
    steps = np.diff(np.append(angles, angles[0]))
    return round(float(((steps + np.pi) % (2 * np.pi) - np.pi).sum() / (2 * np.pi)))


def boxes_miss_the_origin(loop: Array) -> bool:
    ends = np.stack([loop, np.roll(loop, -1, axis=0)])
    beside = (ends.min(axis=0) > CLEARANCE) | (ends.max(axis=0) < -CLEARANCE)
    return bool(beside.any(axis=1).all())


def test_ct5_accepts_exactly_the_loops_of_winding_number_one() -> None:
    """Loops of six points, one piece per finger, against the winding number by angles."""
    hexagon = sliced(HEXAGON)
    x = Variables.of(hexagon, 3)
    block = blocks.object_enclosing(x, hexagon)
    way = cp.Parameter((3, 1, 3, 2))
    once = x.H == 1
    rng = np.random.default_rng(0)
    seen = set()
    for case in range(24):
        quarter = np.cumsum(rng.choice([1, 1, 0, -1], 6) if case % 2 else np.tile([1, 0, 1], 2)[:6])
        angles = np.pi / 2 * quarter + rng.uniform(0.1, 1.4, 6)
        loop = rng.uniform(0.2, 2, (6, 1)) * np.column_stack([np.cos(angles), np.sin(angles)])
        points = loop[[0, 1, 2, 2, 3, 4, 4, 5, 0]]
        way.value = points.reshape(3, 1, 3, 2)
        expected = boxes_miss_the_origin(loop) and winding(loop) == 1
        assert feasible(block, once, x.way == way.value) == expected
        seen.add(expected)
    assert seen == {True, False}


def test_ct6_keeps_fingers_out_of_the_object_at_every_slice(x: Variables, o: SlicedObject) -> None:
    block = blocks.non_penetration(x, o)
    vertices = relative(named_shape("T"))
    for s in (1, o.start):
        for r in range(o.shape[2]):
            for direction in rotation(2 * np.pi / 3 * np.arange(3))[:, 0]:
                largest(direction @ x.p[0], block, x.R[s, 0, r] == 1)
                finger = np.asarray(x.p.value)[0]
                apart = CLEARANCE if s == o.start else 0.0
                assert signed_distance(vertices @ rotation(o.angles[s]).T, finger) >= apart - 1e-7


def test_ct7_turns_conditions_off_beyond_the_limits_alone(x: Variables, o: SlicedObject) -> None:
    block = blocks.limits(x, o)
    assert not feasible(block, x.Theta[o.start] == 1)
    assert not feasible(block, x.Theta[0] == 0)
    assert not feasible(block, x.Theta[-1] == 0)
    assert not feasible(block, x.Theta[3] == 1, x.Theta[4] == 0)
    at_limit = [x.Theta[3] == 1]
    assert not feasible(block, *at_limit, cp.sum(x.R[3, 0]) == 0)
    assert not feasible(block, *at_limit, cp.sum(x.R[4, 0]) == 1)
    assert not feasible(block, x.Theta[3] == 0, cp.sum(x.R[4, 0]) == 0)


def test_ct8_puts_fingers_on_facets_that_turned_with_the_object(x: Variables, o: SlicedObject) -> None:
    block = blocks.limit_contacts(x, o)
    s, n = 4, 1
    for f in (0, 2, 3):
        a, b = o.ends[f] @ rotation(o.angles[s]).T
        normal = rotation(o.angles[s]) @ o.nu[f]
        for sign in (1, -1):
            off = sign * (normal @ x.p[n] - normal @ a)
            assert largest(off, block, x.T[s, n, f] == 1) == pytest.approx(0, abs=1e-7)
        assert largest((b - a) @ (x.p[n] - a), block, x.T[s, n, f] == 1) <= (b - a) @ (b - a) + 1e-7


def test_ct8_wants_as_many_contacts_as_one_limit_has(x: Variables, o: SlicedObject) -> None:
    block = blocks.limit_contacts(x, o)
    limit = [x.Theta == np.array([1, 0, 0, 0, 1])]
    assert not feasible(block, *limit, cp.sum(x.T[4]) == 0)
    assert not feasible(block, *limit, cp.sum(x.T[3]) == 1)
    assert feasible(block, *limit)
    contacts = np.asarray(x.T.value)[4].round()
    assert any(np.array_equal(contacts, chosen > 0) for chosen in o.contacts)


@pytest.mark.parametrize("seed", range(3))
def test_limit_contacts_balance_and_turning_is_the_derivative_of_the_room(seed: int) -> None:
    vertices = relative(random_polygon(np.random.default_rng(seed), 7))
    hexagon = sliced(vertices)
    nu = -facet_frames(vertices)[0]
    contacts = limit_contacts(vertices, 3)
    assert len(contacts)
    np.testing.assert_allclose(np.einsum("cnf,fd->cd", contacts, nu), 0, atol=1e-9)
    np.testing.assert_allclose(contacts.sum(axis=(1, 2)), 1)
    p = np.random.default_rng(seed).normal(size=(3, 2))

    def room(angle: float) -> Array:
        return np.einsum("cnf,de,fe,nd->c", contacts, rotation(angle), nu, p)

    angle, h = 0.3, 1e-6
    turning = np.einsum("cnd,nd->c", hexagon.turning(rotation(np.array([angle])))[0], p)
    np.testing.assert_allclose(turning, (room(angle + h) - room(angle - h)) / (2 * h), atol=1e-8)


def test_a_finger_touches_two_facets_only_at_a_reflex_corner() -> None:
    vertices = relative(random_nonconvex_polygon(np.random.default_rng(3), 8))
    reflex = reflex_vertices(vertices)
    twice = [
        np.flatnonzero(c[n]) for c in limit_contacts(vertices, 2) for n in range(2) if (c[n] > 0).sum() == 2
    ]
    assert twice
    assert all(f + 1 == g and reflex[g] for f, g in twice)


def test_ct9_to_ct11_keep_neighbours_in_touch_between_slices(x: Variables, o: SlicedObject) -> None:
    """Sampled: the obstacles of the pieces that H names share a point at every orientation from limit to limit."""
    block = blocks.continuous_boundary(x, o)
    tight = blocks.limits(x, o)
    rng = np.random.default_rng(0)
    pieces = [shapely.Polygon(_corners(A, b)) for A, b in zip(o.piece_A, o.piece_b, strict=True)]
    choice = [x.H[0, 0, 1] == 1, x.Theta == np.array([1, 0, 0, 0, 1]), cp.sum(x.H[1:]) == 0]
    for _ in range(6):
        largest(rng.normal(size=2) @ (x.p[0] - x.p[1]), block, tight, *choice)
        p = np.asarray(x.p.value)
        for angle in np.linspace(-HALF, HALF, 81):
            first, second = (
                shapely.Polygon(p[n] - np.array(pieces[i].exterior.coords) @ rotation(angle).T)
                for n, i in ((0, 0), (1, 1))
            )
            assert first.distance(second) < 1e-7


def _corners(A: Array, b: Array) -> Array:
    return clip(9 * np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]]), A, b)


def test_the_cut_excludes_one_choice_and_no_other() -> None:
    a, b = cp.Variable(2, boolean=True), cp.Variable(3, boolean=True)
    ones = ([1, 0], [0, 1, 1])
    block = blocks.not_again([(a, np.array(ones[0])), (b, np.array(ones[1]))])
    assert not feasible(block, a == ones[0], b == ones[1])
    assert feasible(block, a == [0, 1], b == ones[1])
    assert feasible(block, a == ones[0], b == [0, 1, 0])
