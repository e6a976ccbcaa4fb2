"""The baseline grasp: chosen for its quality, reached along normals, and lost on the way from uncertain starts."""

import itertools

import numpy as np
import pytest
from scipy.spatial import ConvexHull, QhullError

from expert.geometry.polygon import mass_properties, signed_distance
from expert.geometry.pose import Array, to_body
from expert.grasping.force_closure import best_grasp, least_distance
from expert.world.named import named_shape
from expert.world.shape import Shape

T = Shape(vertices=named_shape("T"))
GRASP = best_grasp(T, 0.02)


def ball(shape: Shape, points: Array, normals: Array) -> float:
    """Largest ball about the origin in the hull of four wrenches, by Qhull."""
    plate = mass_properties(shape.vertices)
    arm = (points - plate.centroid) / np.sqrt(plate.second_moment / plate.area)
    wrenches = -np.column_stack([normals, arm[:, 0] * normals[:, 1] - arm[:, 1] * normals[:, 0]])
    try:
        return float(-ConvexHull(wrenches).equations[:, 3].max())
    except QhullError:  # flat
        return 0.0


def test_the_quality_is_the_radius_of_the_ball_of_wrenches() -> None:
    assert GRASP.quality == pytest.approx(ball(T, GRASP.points, GRASP.normals), abs=1e-12)
    assert GRASP.quality > 0.3


def test_no_other_four_corners_of_facets_are_better() -> None:
    """Against brute force over facet quadruples with contacts moved inward from both ends of each facet."""
    v = T.vertices
    w = np.roll(v, -1, axis=0)
    edge = (w - v) / np.linalg.norm(w - v, axis=1, keepdims=True)
    outward = np.column_stack([edge[:, 1], -edge[:, 0]])
    points = np.concatenate([v + 0.1 * (w - v), w - 0.1 * (w - v)])
    normals = np.concatenate([outward, outward])
    best = max(ball(T, points[list(c)], normals[list(c)]) for c in itertools.combinations(range(16), 4))
    assert GRASP.quality >= best - 1e-9


def test_fingers_approach_along_normals_and_touch_in_the_end() -> None:
    pose = np.array([0.1, -0.2, 0.7])
    path = GRASP.approach(pose, 0.02)
    np.testing.assert_allclose(np.linalg.norm(path[0] - path[1], axis=1), 0.02)
    np.testing.assert_allclose(signed_distance(T.vertices, to_body(pose, path[1])), 0, atol=1e-12)
    assert signed_distance(T.vertices, to_body(pose, path[0])).min() > 0


def test_fingers_begin_outside_of_every_start() -> None:
    rng = np.random.default_rng(0)
    starts = np.column_stack([rng.normal(0, 0.004, (30, 2)), rng.normal(0, 0.1, 30)])
    distance = least_distance(T, GRASP, np.zeros(3), starts)
    fingers = GRASP.approach(np.zeros(3), distance)[0]
    closer = GRASP.approach(np.zeros(3), distance - 0.01 * T.size)[0]
    assert all(signed_distance(T.vertices, to_body(q, fingers)).min() > 0 for q in starts)
    assert any(signed_distance(T.vertices, to_body(q, closer)).min() < 1e-5 * T.size for q in starts)
