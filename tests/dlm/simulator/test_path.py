"""The desired motion between the knots."""

import numpy as np
import pytest

from dlm.simulator import Execution, SimulatorSettings
from dlm.simulator.path import desired_motion
from expert.geometry.pose import rotation, to_world
from tests.support.scenes import T


def motion_of(path, **execution):
    settings = SimulatorSettings(execution=Execution(**execution))
    return desired_motion(np.asarray(path, dtype=float), 0.03, settings.numbers)


def test_the_path_meets_its_knots_and_starts_and_ends_at_rest():
    path = np.cumsum(np.random.default_rng(0).normal(0, [0.01, 0.01, 0.2], (T, 3)), axis=0)
    motion = motion_of(path)
    np.testing.assert_allclose(motion[::20], path, atol=1e-15)
    steps = np.linalg.norm(np.diff(motion, axis=0), axis=1)
    assert steps[0] < 0.15 * steps[:20].max()
    assert steps[-1] < 0.15 * steps[-20:].max()


def test_a_pivot_keeps_its_vertex_still_between_the_knots():
    vertex, angles = np.array([-0.03, -0.02]), np.array([0, 0.1, 0.3, 0.5, 0.55])
    path = np.column_stack([-np.stack([rotation(a) @ vertex for a in angles]), angles])
    corner = to_world(motion_of(path), vertex[None])[:, 0]
    assert np.abs(corner - corner[0]).max() < 1e-15


def test_timing_is_monotone_and_stops_in_sharp_corners():
    path = np.array([[0, 0, 0], [0.01, 0, 0], [0.02, 0, 0], [0.02, 0.01, 0], [0.02, 0.02, 0]])
    motion = motion_of(path)
    assert (np.diff(motion[:, :2], axis=0) >= -1e-15).all()
    speed = np.linalg.norm(np.diff(motion[:, :2], axis=0), axis=1)
    assert speed[39:41].max() < 0.2 * speed.max()
    assert np.linalg.norm(np.diff(motion_of(path, eased=False), axis=0), axis=1) == pytest.approx(0.01 / 20)
