"""Goal cells: what the rows imply, what the cell is, and that it has no dead end, each stated a second time by sampling."""

import functools
import itertools

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog, nnls

from expert.geometry.polygon import signed_area
from expert.geometry.pose import Array, rotation
from expert.grasping.cell import GoalCell
from expert.grasping.facets import Facets, tuples
from expert.grasping.goal_cell import candidate, cells, largest_start, region, start_knot
from expert.grasping.rows import Rows
from expert.grasping.smooth import acceleration, smoothest
from expert.loops.normals import rays, spans
from expert.world.frame import Frame
from expert.world.named import named_shape
from expert.world.shape import Shape
from tests.support.polygons import irregular_polygon

RANGES = np.radians([15, 11.25, 7.5, 3.75, 0.5])
MARGIN = 0.002


def relative(vertices: Array) -> Array:
    shape = Shape(vertices=vertices)
    return Frame.of(shape, np.zeros(3)).body(shape.vertices)


def objects() -> dict[str, Array]:
    named = {name: relative(named_shape(name)) for name in ("T", "hourglass", "arrow")}
    return named | {
        f"random {k}": relative(irregular_polygon(np.random.default_rng(k), 4 + k % 3)) for k in (2, 10)
    }


@functools.cache
def best(name: str) -> tuple[GoalCell, Array]:
    """The goal cell with the largest start of an object, and its path."""
    table = Facets.of(objects()[name])
    found = [c for cell in cells(table, 4, MARGIN) if (c := candidate(cell, RANGES)) is not None]
    known = max(found, key=lambda c: c.attraction)
    cell = known.cell
    knots = [cell.knot(RANGES[max(k - 1, 0)], RANGES[k]) for k in range(len(RANGES) - 1)]
    path = smoothest([*knots, cell.end(RANGES[-2], 0.5 * known.firmest)], known.start)
    assert path is not None
    return cell, path


def component(vertices: Array, fingers: Array, angle: float, inside: Array) -> shapely.Polygon:
    """Free translations at an orientation that join `inside`, from the definition of free space."""
    turned = vertices @ rotation(angle).T
    obstacles = shapely.union_all([shapely.Polygon(p - turned) for p in fingers])
    free = shapely.box(-3, -3, 3, 3).difference(obstacles)
    parts = list(getattr(free, "geoms", [free]))
    return min(parts, key=lambda part: part.distance(shapely.Point(inside)))


vectors = st.lists(st.floats(-2, 2), min_size=2, max_size=2)


@settings(max_examples=40)
@given(
    st.lists(st.tuples(vectors, vectors), min_size=1, max_size=3),
    st.floats(-1.5, 0),
    st.floats(0.01, 1.5),
    st.floats(0, 1),
)
def test_rows_over_a_range_imply_every_orientation_in_it(
    pairs: list, low: float, width: float, share: float
) -> None:
    V, p = (np.array([[pair[k] for pair in pairs]]) for k in (0, 1))
    sharp = Rows(V, np.array([-np.inf]), np.array([0.0]))
    least = sharp.over(low, low + width).violation(p[0]).max()
    at = sharp.at(low + share * width).violation(p[0])[0]
    length = float(np.hypot((V * p).sum(), (V[..., 0] * p[..., 1] - V[..., 1] * p[..., 0]).sum()))
    assert at <= least + 1e-9
    samples = [sharp.at(t).violation(p[0])[0] for t in np.linspace(low, low + width, 200)]
    assert least <= max(samples) + 4e-4 * length + 1e-9


@settings(max_examples=40)
@given(st.integers(0, 10_000), st.integers(3, 5))
def test_rays_generate_all_balanced_weights(seed: int, count: int) -> None:
    angles = np.random.default_rng(seed).uniform(0, 2 * np.pi, count)
    normals = np.column_stack([np.cos(angles), np.sin(angles)])
    found = rays(normals)
    assert (found >= 0).all()
    assert np.abs(found @ normals).max(initial=0.0) < 1e-9
    goal = np.random.default_rng(seed + 1).uniform(-1, 1, count)
    balanced = linprog(-goal, A_eq=np.vstack([normals.T, np.ones(count)]), b_eq=[0, 0, 1], bounds=(0, None))
    assert balanced.success == (len(found) > 0)
    if balanced.success:
        assert nnls(found.T, balanced.x)[1] < 1e-7


def test_facet_tuples_are_those_that_hold_against_any_push() -> None:
    for vertices in objects().values():
        table = Facets.of(vertices)
        listed = {tuple(sorted(t)) for t in tuples(table, 4)}
        angles = np.linspace(0, 2 * np.pi, 60)
        across = np.concatenate(
            [table.tangents, -table.tangents]
        )  # a push that no finger resists is next to one of these
        pushes = [*across, *np.column_stack([np.cos(angles), np.sin(angles)])]
        for chosen in itertools.combinations_with_replacement(range(len(table)), 4):
            if max(chosen.count(k) for k in chosen) > 2:
                continue
            resist = all((table.normals[list(chosen)] @ push).max() > 1e-6 for push in pushes)
            assert resist == (chosen in listed)


def test_half_a_turn_between_normals_does_not_span() -> None:
    normals = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]])
    assert not spans(normals)
    assert spans(np.vstack([normals, [[0.0, -1.0]]]))


@pytest.mark.parametrize("name", objects())
def test_wedges_are_free_and_reach_their_facets(name: str) -> None:
    vertices = objects()[name]
    table = Facets.of(vertices)
    a, b = vertices, np.roll(vertices, -1, axis=0)
    points = np.random.default_rng(0).uniform(-1.5, 1.5, (20_000, 2))
    inside = shapely.contains_xy(shapely.Polygon(vertices).buffer(-1e-9), points)
    for k in range(len(table)):
        space = table.beyond(k)
        over = (points @ space.A.T < space.b - 1e-9).all(axis=1)
        assert not (over & inside).any()
        middle = (a[k] + b[k]) / 2 + 1e-6 * table.normals[k]
        assert (space.A @ middle <= space.b).all()


@pytest.mark.parametrize("name", objects())
def test_the_cell_is_the_goals_whole_free_component_at_every_moment(name: str) -> None:
    vertices = objects()[name]
    cell, path = best(name)
    rng = np.random.default_rng(0)
    seen = 0
    for s, share in rng.uniform(0, [len(path) - 1, 1], (60, 2)):
        k = int(s)
        fingers = path[k] + (s - k) * (path[k + 1] - path[k])
        angle = (2 * share - 1) * RANGES[k]
        polygon = region_at(cell, fingers, angle)
        if len(polygon) < 3 or abs(signed_area(polygon)) < 1e-7:
            continue
        whole = component(vertices, fingers, angle, polygon.mean(axis=0))
        assert whole.symmetric_difference(shapely.Polygon(polygon)).area < 1e-9
        seen += 1
    assert seen > 10


def region_at(cell: GoalCell, fingers: Array, angle: float) -> Array:
    """The cell's slice at an orientation: region() at an angle of zero, in the body's axes."""
    return region(cell, fingers @ rotation(angle)) @ rotation(angle).T


@pytest.mark.parametrize("name", objects())
def test_the_cell_exists_for_an_interval_of_orientations_within_its_half_range(name: str) -> None:
    cell, path = best(name)
    for s in np.linspace(0, len(path) - 1 - 1e-6, 33):
        k = int(s)
        fingers = path[k] + (s - k) * (path[k + 1] - path[k])
        angles = np.linspace(-RANGES[max(k - 1, 0)], RANGES[max(k - 1, 0)], 401)
        reach = np.einsum("nd,txd,nx->tn", cell.normals, rotation(angles), fingers) - cell.offsets
        holds = (reach @ cell.rays.T >= 0).all(axis=1)
        inside = np.flatnonzero(holds)
        assert holds[200]
        assert holds[inside[0] : inside[-1] + 1].all()
        assert np.abs(angles[inside]).max() < RANGES[k]


@pytest.mark.parametrize("name", objects())
def test_the_end_is_held_to_first_order_against_turning_both_ways(name: str) -> None:
    cell, path = best(name)
    n, p = cell.normals, path[-1]
    assert (n * p).sum(axis=1) == pytest.approx(cell.offsets, abs=1e-9)
    wrenches = np.column_stack([-n, -(p[:, 0] * n[:, 1] - p[:, 1] * n[:, 0])])
    equilibrium = linprog(np.zeros(4), A_eq=wrenches.T, b_eq=np.zeros(3), bounds=(1e-4, None))
    assert np.linalg.matrix_rank(wrenches) == 3
    assert equilibrium.success


def test_no_start_that_meets_the_rows_is_larger_than_the_largest() -> None:
    for name in ("T", "random 10"):
        cell, _ = best(name)
        rows = cell.knot(RANGES[0], RANGES[0])
        first = start_knot(cell, rows)
        assert first is not None
        area, fingers = largest_start(cell, rows, first[1])
        assert rows.violation(fingers).max() < 1e-7
        assert area == pytest.approx(shapely.Polygon(region(cell, fingers)).area)
        assert area >= shapely.Polygon(region(cell, first[1])).area - 1e-12
        rng = np.random.default_rng(0)
        V = rows.V.reshape(len(rows.V), -1)
        for _ in range(15):
            A, b = np.vstack([V, -V]), np.concatenate([rows.high, -rows.low])
            finite = np.isfinite(b)
            other = linprog(rng.normal(size=8), A_ub=A[finite], b_ub=b[finite], bounds=(-4, 4)).x.reshape(
                4, 2
            )
            for share in (0.0, 0.5):
                mixed = share * first[1] + (1 - share) * other
                polygon = region(cell, mixed)
                assert len(polygon) < 3 or abs(signed_area(polygon)) <= 1.02 * area


def test_no_path_between_the_same_rows_is_smoother() -> None:
    cell, path = best("random 2")
    knots = [cell.knot(RANGES[max(k - 1, 0)], RANGES[k]) for k in range(len(RANGES) - 1)]
    assert max(rows.violation(p).max() for rows, p in zip(knots, path, strict=False)) < 1e-8
    rng = np.random.default_rng(0)
    for _ in range(20):
        costs = rng.normal(size=(4, 8))
        other = [path[0]]
        for rows, cost in zip([*knots[1:], cell.end(RANGES[-2], 0.05)], costs, strict=True):
            V = rows.V.reshape(len(rows.V), -1)
            A, b = np.vstack([V, -V]), np.concatenate([rows.high, -rows.low])
            finite = np.isfinite(b)
            other.append(linprog(cost, A_ub=A[finite], b_ub=b[finite], bounds=(-4, 4)).x.reshape(4, 2))
        for share in (1.0, 0.1):
            mixed = path + share * (np.array(other) - path)
            steps = (np.diff(mixed, axis=0) ** 2).sum() - (np.diff(path, axis=0) ** 2).sum()
            assert acceleration(mixed) + 1e-3 * steps >= acceleration(path) - 1e-3 * 0.05


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 1000))
def test_three_fingers_end_where_their_normals_meet(seed: int) -> None:
    vertices = relative(irregular_polygon(np.random.default_rng(seed), 4))
    found = [
        c for cell in cells(Facets.of(vertices), 3, MARGIN) if (c := candidate(cell, RANGES)) is not None
    ]
    for known in found[:1]:
        cell = known.cell
        knots = [cell.knot(RANGES[max(k - 1, 0)], RANGES[k]) for k in range(len(RANGES) - 1)]
        path = smoothest([*knots, cell.end(RANGES[-2])], known.start)
        assert path is not None
        moment = cell.rays[0] @ (cell.table.tangents[list(cell.chosen)] * path[-1]).sum(axis=1)
        assert moment == pytest.approx(0.0, abs=1e-9)
