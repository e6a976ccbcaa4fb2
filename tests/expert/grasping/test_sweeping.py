"""The sweeping process against closed forms, against a general optimizer, and against predicted jams."""

import numpy as np
import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize, nnls

from expert.errors import InvalidProblem
from expert.geometry.polygon import signed_distance
from expert.geometry.pose import Array, to_body, to_world
from expert.grasping.sweeping import sweep
from expert.numeric.least_norm import least_norm
from expert.world.named import named_shape
from expert.world.shape import Shape
from tests.support.polygons import irregular_polygon

HALF_WIDTH, HALF_HEIGHT = 0.05, 0.03
BOX = Shape(
    vertices=np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * np.array([HALF_WIDTH, HALF_HEIGHT]),
)
PAIRS = np.array([[0.02, -0.03], [0.05, -0.015], [-0.02, 0.03], [-0.05, 0.015]])
"""Four contacts on the box in form closure."""
OUTWARD = np.array([[0, -1], [1, 0], [0, 1], [-1, 0]])


def closing(distances: list[float]) -> Array:
    return np.stack([PAIRS + d * OUTWARD for d in distances])


def box_starts(count: int) -> Array:
    rng = np.random.default_rng(0)
    return np.column_stack([rng.uniform(-0.006, 0.006, (count, 2)), rng.uniform(-0.1, 0.1, count)])


def still(path: Array, **options: Array) -> Array:
    """Last pose of the box pushed from pose 0."""
    result = sweep(BOX, path, np.zeros((1, 3)), **options)  # type: ignore[arg-type]
    assert np.isnan(result.stalled[0])
    return result.ends[0]


def test_a_push_through_the_centroid_is_a_translation() -> None:
    end = still(np.array([[[0.0, -0.04]], [[0.0, 0.01]]]))
    np.testing.assert_allclose(end, [0, 0.01 + HALF_HEIGHT, 0], atol=1e-15)


def test_a_free_finger_moves_nothing() -> None:
    end = still(np.array([[[0.08, -0.04]], [[0.08, 0.04]]]))
    np.testing.assert_array_equal(end, 0)


def test_an_off_centre_push_keeps_its_invariant() -> None:
    """With the support's centre of resistance on the pushed facet, (rho^2 + a^2) cos^2 theta stays constant.

    For a finger that moves along y, with offset a along the facet: dtheta = a lambda / rho^2, cos theta ds = lambda
    (1 + a^2 / rho^2) and da = sin theta ds, hence a da / (rho^2 + a^2) = tan theta dtheta.
    """
    rho, start = 0.04, 0.02
    r, size = -HALF_HEIGHT, BOX.size
    to_centre = np.array([[1, 0, -r / size], [0, 1, 0], [0, 0, 1]])
    metric = to_centre.T @ np.diag([1, 1, (rho / size) ** 2]) @ to_centre
    path = np.array([[[start, -HALF_HEIGHT]], [[start, 0.0]]])
    errors = []
    for step in (3e-4, 3e-5):
        end = still(path, metric=metric, step=step)  # type: ignore[arg-type]
        a, height = to_body(end, path[1])[0]
        assert height == pytest.approx(-HALF_HEIGHT, abs=1e-12)
        assert end[2] > 0.2
        errors.append(abs((rho**2 + a**2) * np.cos(end[2]) ** 2 / (rho**2 + start**2) - 1))
    assert errors[0] < 1e-4
    assert errors[1] < 0.15 * errors[0]  # first order in the step


def test_two_fingers_turn_a_facet_flush() -> None:
    path = np.array([[[-0.02, -0.05], [0.03, -0.05]], [[-0.02, 0.0], [0.03, 0.0]]])
    end = sweep(BOX, path, np.array([[0.0, 0.0, 0.2]])).ends[0]
    assert end[2] == pytest.approx(0, abs=1e-9)
    assert end[1] == pytest.approx(HALF_HEIGHT, abs=1e-9)


def test_a_finger_slips_off_a_corner_and_pushes_no_more() -> None:
    path = np.array([[[0.049, -0.05]], [[0.049, 0.08]]])
    result = sweep(BOX, path, np.zeros((1, 3)))
    assert np.isnan(result.stalled[0])
    assert np.ptp(result.poses[0, -3:], axis=0).max() == 0
    assert signed_distance(BOX.vertices, to_body(result.ends[0], path[-1]))[0] > 0.01


@settings(max_examples=200, deadline=None)
@given(st.integers(0, 10**9))
def test_a_finger_that_passes_by_moves_nothing(seed: int) -> None:
    """However close to a corner: beyond a sharp tip it is inside of one facet's half-plane and yet outside."""
    rng = np.random.default_rng(seed)
    vertices = named_shape("hourglass") if seed % 2 else irregular_polygon(rng, int(rng.integers(4, 9)))
    size = Shape(vertices=vertices).size
    near = vertices[rng.integers(len(vertices))] + 0.008 * size * rng.normal(size=2)
    path = np.stack([near, near + 0.05 * size * rng.normal(size=2)])
    assume(shapely.Polygon(vertices).distance(shapely.LineString(path)) > 1e-5 * size)
    result = sweep(Shape(vertices=vertices), path[:, None], np.zeros((1, 3)))
    assert np.isnan(result.stalled[0])
    np.testing.assert_array_equal(result.ends, 0)


@pytest.mark.parametrize("tilt", [0.0, 0.01, -0.2])
def test_a_squeeze_jams_when_the_fingers_are_as_near_as_the_faces(tilt: float) -> None:
    """Two opposite fingers turn the box until it is flush between them; closer than its height they cannot come."""
    path = np.array([[[0.0, -0.05], [0.0, 0.05]], [[0.0, -0.01], [0.0, 0.01]]])
    result = sweep(BOX, path, np.array([[0.001, 0.002, tilt]]))
    assert result.stalled[0] == pytest.approx(0.5, abs=1e-6)
    assert result.ends[0, 2] == pytest.approx(0, abs=1e-3)
    assert result.ends[0, 1] == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize(
    "metric", [None, np.diag([1, 1, 0.5]), np.diag([1, 4, 0.02]), [[2, 0.5, 0.1], [0.5, 1, 0], [0.1, 0, 0.1]]]
)
def test_a_form_closed_end_does_not_depend_on_the_support(metric: Array | None) -> None:
    result = sweep(BOX, closing([0.02, 0.01, 0.004, 0.0]), box_starts(100), metric=metric)
    assert np.isnan(result.stalled).all()
    np.testing.assert_allclose(result.ends, 0, atol=1e-12)


def test_the_motion_on_the_way_does_depend_on_the_support() -> None:
    path, starts = closing([0.02, 0.008]), box_starts(20)
    ends = [sweep(BOX, path, starts, metric=np.diag([1, 1, w])).ends for w in (0.02, 2.0)]
    assert np.abs(ends[0] - ends[1]).max() > 1e-4


def test_everything_may_be_moved_rigidly() -> None:
    motion = np.array([0.4, -0.2, 2.0])
    path, starts = closing([0.02, 0.01, 0.004]), box_starts(20)
    here = sweep(BOX, path, starts).poses
    moved = np.column_stack([to_world(motion, starts[:, :2]), starts[:, 2] + motion[2]])
    there = sweep(BOX, to_world(motion, path), moved, goal=motion).poses
    np.testing.assert_allclose(
        there[..., :2], to_world(motion, here[..., :2].reshape(-1, 2)).reshape(here[..., :2].shape), atol=1e-9
    )
    np.testing.assert_allclose(there[..., 2], here[..., 2] + motion[2], atol=1e-8)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6))
def test_no_finger_ever_enters_the_object(seed: int) -> None:
    rng = np.random.default_rng(seed)
    vertices = irregular_polygon(rng, int(rng.integers(4, 9))) if seed % 3 else named_shape("T")
    shape = Shape(vertices=vertices)
    angles = rng.uniform(0, 2 * np.pi, 4)
    rays = np.column_stack([np.cos(angles), np.sin(angles)])
    path = np.stack([0.12 * rays, rng.uniform(0.01, 0.08, (4, 1)) * rays])
    result = sweep(shape, path, np.zeros((1, 3)), samples=50)
    stop = result.stalled[0] if np.isfinite(result.stalled[0]) else 1.0
    for s, pose in zip(result.s, result.poses[0], strict=True):
        fingers = path[0] + min(s, stop) * (path[1] - path[0])
        if s <= stop:
            assert signed_distance(vertices, to_body(pose, fingers)).min() > -1e-11 * shape.size


def test_a_step_is_the_shortest_motion_to_a_free_pose() -> None:
    """One step against a general optimizer, in coordinates scaled by the radius of gyration."""
    path = np.array([[[0.02, -HALF_HEIGHT], [HALF_WIDTH, 0.01]], [[0.02, -0.02999], [0.04998, 0.01]]])
    gyration = np.sqrt((HALF_WIDTH**2 + HALF_HEIGHT**2) / 3)

    def pose(z: Array) -> Array:
        return z / np.array([1, 1, gyration])

    def gaps(z: Array) -> Array:
        bottom, side = to_body(pose(z), path[1])
        return 1e3 * np.array([-HALF_HEIGHT - bottom[1], side[0] - HALF_WIDTH])

    best = minimize(
        lambda z: 1e10 * z @ z,
        np.zeros(3),
        jac=lambda z: 2e10 * z,
        constraints={"type": "ineq", "fun": gaps},
        options={"ftol": 1e-16},
    )
    np.testing.assert_allclose(still(path, step=1e-3, samples=1), pose(best.x), atol=1e-9)  # type: ignore[arg-type]


@settings(max_examples=300, deadline=None)
@given(st.integers(0, 10**9), st.integers(1, 8))
def test_the_small_quadratic_programme_agrees_with_nonnegative_least_squares(seed: int, count: int) -> None:
    """min |u|^2 with A u >= b by its dual, a non-negative least-squares problem (Lawson, Hanson)."""
    rng = np.random.default_rng(seed)
    A, b, u = rng.normal(size=(8, 3)), rng.normal(size=8) + rng.choice([-1, 0, 1]), np.empty(3)
    solvable = least_norm(A, b, count, u)
    E = np.vstack([A[:count].T, b[:count]])
    f = np.array([0.0, 0, 0, 1])
    weights, distance = nnls(E, f)
    residual = E @ weights - f
    assert solvable == (distance > 1e-6)
    if solvable:
        np.testing.assert_allclose(u, -residual[:3] / residual[3], atol=1e-6 * (1 + np.abs(u).max()))


def test_a_start_inside_a_finger_is_refused() -> None:
    with pytest.raises(InvalidProblem, match=r"starts\[1\]"):
        sweep(BOX, closing([0.02, 0.0]), np.array([[0.0, 0, 0], [0.03, 0, 0]]))


@pytest.mark.parametrize(
    ("options", "field"),
    [({"step": 0.0}, "step"), ({"step": 0.1}, "step"), ({"metric": np.diag([1, 1, 0])}, "metric")],
)
def test_bad_settings_are_refused(options: dict, field: str) -> None:
    with pytest.raises(InvalidProblem, match=field):
        sweep(BOX, closing([0.02, 0.0]), np.zeros((1, 3)), **options)
