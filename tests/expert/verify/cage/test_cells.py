"""Inner and outer shapes hold for every orientation of a cell, and halving a cell never loses ground."""

import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st

from expert.geometry.pose import Array, rotation, to_body
from expert.problems.cage import Arrangement
from expert.verify.cage.cells import DEGREE, Cell, CellComplex, inner_piece, outer_piece
from expert.world.frame import Frame
from expert.world.named import named_shape
from expert.world.shape import Shape
from expert.world.walls import segments


def convex(rng: np.random.Generator) -> Array:
    hull = shapely.MultiPoint(rng.normal(size=(6, 2)) + rng.normal(size=2)).convex_hull
    return np.array(shapely.geometry.polygon.orient(hull).exterior.coords)[:-1]


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), st.floats(1e-4, 0.3))
def test_shapes_bound_a_turning_piece_from_both_sides(seed: int, half: float) -> None:
    piece = convex(np.random.default_rng(seed))
    piece /= 1.01 * np.linalg.norm(piece, axis=1).max()
    inner = inner_piece(piece, half)
    outer = shapely.Polygon(outer_piece(piece, half)).buffer(1e-12)
    for angle in np.linspace(-half, half, 41):
        turned = shapely.Polygon(piece @ rotation(angle).T)
        assert outer.covers(turned)
        assert len(inner) < 3 or turned.buffer(1e-12).covers(shapely.Polygon(inner))


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), st.floats(1e-3, 0.15))
def test_shapes_of_half_a_cell_are_closer(seed: int, half: float) -> None:
    piece = convex(np.random.default_rng(seed))
    piece /= 1.01 * np.linalg.norm(piece, axis=1).max()
    wide_in, wide_out = inner_piece(piece, half), outer_piece(piece, half)
    for side in (-half / 2, half / 2):
        turn = rotation(side).T
        fine_out = shapely.Polygon(outer_piece(piece, half / 2) @ turn)
        assert shapely.Polygon(wide_out).buffer(1e-9).covers(fine_out)
        if len(wide_in) >= 3:
            fine_in = shapely.Polygon(inner_piece(piece, half / 2) @ turn)
            assert fine_in.buffer(1e-9).covers(shapely.Polygon(wide_in))


def test_the_gap_between_both_sides_closes_with_the_cell() -> None:
    piece = convex(np.random.default_rng(3))
    piece /= np.linalg.norm(piece, axis=1).max()
    gaps = [
        shapely.Polygon(outer_piece(piece, h)).area - shapely.Polygon(inner_piece(piece, h)).area
        for h in (0.1, 0.01, 0.001)
    ]
    assert gaps[1] < 0.2 * gaps[0]
    assert gaps[2] < 0.2 * gaps[1]


@pytest.mark.parametrize("width", [0, 1, 16, 256, 2048])
def test_components_enclose_and_are_enclosed_by_the_free_space(width: int) -> None:
    rng = np.random.default_rng(width)
    fingers = np.array([[-0.03, 0.0], [0.03, 0.01], [0.0, 0.06]])
    walls = np.array([[[-0.1, -0.09], [0.1, -0.08]]])
    arrangement = Arrangement(
        shape=Shape(vertices=named_shape("T")), pose=np.zeros(3), fingers=fingers, walls=segments(walls)
    )
    complex_, frame = CellComplex(arrangement), Frame.of(arrangement.shape, arrangement.pose)
    cell = Cell(37 * width, width)
    inner = shapely.union_all(complex_.inner(cell).polygons)
    outer = shapely.union_all(complex_.outer(cell).polygons)
    low, high = cell.bounds
    counts = [0, 0]
    for _ in range(400):
        configuration = np.append(rng.uniform(-2, 2, 2), rng.uniform(low, high))
        point = shapely.Point(configuration[:2])
        free = is_free(arrangement, frame.world_pose(configuration))
        counts[free] += 1
        assert not free or inner.covers(point)
        assert free or not outer.buffer(-1e-8).covers(point)
    assert min(counts) > 50


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6), st.booleans())
@example(53804, False)  # nothing is free in the window
def test_a_window_shows_the_same_free_space_and_what_leaves_it_is_unbounded(seed: int, on_grid: bool) -> None:
    rng = np.random.default_rng(seed)
    shape, around = Shape(vertices=named_shape("T")), rng.uniform(0, 2 * np.pi, 6)
    frame, distances = Frame.of(shape, np.zeros(3)), rng.uniform(1.01, 1.4, 6)
    fingers = frame.centre + frame.radius * distances[:, None] * np.column_stack(
        [np.cos(around), np.sin(around)]
    )
    arrangement = Arrangement(shape=shape, pose=np.zeros(3), fingers=fingers)
    corner = rng.uniform(-1, 0, 2)
    window = shapely.box(*corner, *(corner + rng.uniform(0.2, 2, 2)))
    cell = Cell(DEGREE * int(rng.integers(360)), DEGREE)
    whole = CellComplex(arrangement, on_grid=on_grid).inner(cell)
    seen = CellComplex(arrangement, window=window, on_grid=on_grid).inner(cell)
    expected = shapely.intersection(shapely.union_all(whole.polygons), window)
    assert shapely.symmetric_difference(shapely.union_all(seen.polygons), expected).area < 1e-7
    for part, unbounded in zip(seen.polygons, seen.unbounded, strict=True):
        origin = whole.polygons[shapely.area(shapely.intersection(whole.polygons, part)).argmax()]
        assert unbounded == (shapely.difference(origin, window).area > 1e-7)


def is_free(arrangement: Arrangement, pose: Array) -> bool:
    polygon = shapely.Polygon(arrangement.shape.vertices)
    points = shapely.points(to_body(pose, arrangement.fingers))
    walls = [shapely.LineString(to_body(pose, ends)) for ends in arrangement.wall_ends]
    return not shapely.intersects(polygon, [*points, *walls]).any()


def test_the_frame_keeps_shape_and_start() -> None:
    pose = np.array([0.3, -0.2, 2.5])
    arrangement = Arrangement(
        shape=Shape(vertices=named_shape("T") + 0.4), pose=pose, fingers=np.array([[5.0, 5.0], [6.0, 5.0]])
    )
    frame = Frame.of(arrangement.shape, arrangement.pose)
    assert frame.world_pose(np.zeros(3)) == pytest.approx(pose)
    moved = frame.world_pose(np.array([0.5, 0.25, 0.1]))
    # A world point fixed to the object has relative coordinates that turn by 0.1 about the moved reference.
    point = np.array([0.41, 0.43])
    world = rotation(moved[2]) @ point + moved[:2]
    expected = np.array([0.5, 0.25]) + rotation(0.1) @ (point - frame.centre) / frame.radius
    assert frame.relative(world) == pytest.approx(expected)
