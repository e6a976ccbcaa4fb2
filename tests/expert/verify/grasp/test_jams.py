"""Must fail: nested cages with a form-closed end are not enough; the checker names a start that jams, and it does."""

import numpy as np
import pytest

from expert.grasping.sweeping import sweep
from expert.problems.cage import Arrangement
from expert.verify.cage.check import verify_cage
from expert.verify.grasp.check import verify_grasp
from expert.verify.grasp.finger_path import FingerPath
from tests.support.jams import jams

JAMS = jams()


@pytest.mark.parametrize("name", JAMS)
def test_the_thesis_conditions_hold(name: str) -> None:
    """Each knot's cage, asked of the cage verifier alone; half-ranges that decrease; a finger on each of four facets."""
    problem, path = JAMS[name]
    assert (np.diff(problem.half_ranges) < 0).all()
    for fingers, half in zip(path[:-1], problem.half_ranges[:-1], strict=True):
        arrangement = Arrangement(shape=problem.shape, pose=problem.pose, fingers=fingers)
        report = verify_cage(arrangement, within=(-half, half))
        assert report.verdict == "caged"
        assert report.rotation_range is not None
        assert np.abs(report.rotation_range).max() <= half
    assert FingerPath(problem.shape, problem.pose, path).gap(
        np.zeros((1, 3)), len(path) - 1.0
    ) == pytest.approx(0, abs=1e-7)


@pytest.mark.parametrize("name", JAMS)
def test_a_start_that_jams_is_named(name: str) -> None:
    problem, path = JAMS[name]
    report = verify_grasp(problem, path)
    assert report.cages
    assert report.cages.held
    assert report.end
    assert (report.end.form_closure, report.end.observability_rank) == (1, 3)
    assert report.verdict == "refuted"
    assert report.dead_ends
    assert report.start
    certain = [event for event in report.dead_ends.events if event.witness is not None]
    witnesses = np.array([event.witness for event in certain])
    assert report.start.contains(witnesses).all()
    run = sweep(problem.shape, path, witnesses)
    np.testing.assert_allclose(run.stalled, [event.s for event in certain], atol=1e-3)
    distance, angle = run.misses(problem.pose)
    assert ((distance > 1e-3 * problem.shape.size) | (angle > np.radians(0.1))).all()
    random = sweep(problem.shape, path, report.start.starts(np.random.default_rng(0), 300)).stalled
    stalled = random[np.isfinite(random)]
    listed = np.array([event.s for event in report.dead_ends.events])
    assert len(stalled) > 0
    assert np.abs(stalled[:, None] - listed[None]).min(axis=1).max() < 5e-3
