"""Starts are proven to be held, and a seed draws the same ones however the set was found."""

import numpy as np
import pytest

from expert.geometry.polygon import signed_distance
from expert.geometry.pose import to_body
from expert.verify.cage import cells
from expert.verify.grasp import slab, start_set
from expert.verify.grasp.finger_path import FingerPath
from expert.verify.grasp.start_set import StartSet
from tests.support.jams import jams


def quadrangle() -> StartSet:
    problem, path = jams()["quadrangle"]
    return StartSet(FingerPath(problem.shape, problem.pose, path))


def test_starts_are_clear_of_the_fingers_and_members_of_the_set() -> None:
    starts = quadrangle()
    drawn = starts.starts(np.random.default_rng(0), 50)
    _, path = jams()["quadrangle"]
    for pose in drawn:
        assert signed_distance(starts.path.shape.vertices, to_body(pose, path[0])).min() >= 0
    assert starts.contains(drawn).all()


def test_a_seed_draws_the_same_starts_whatever_cells_are_counted_in(monkeypatch: pytest.MonkeyPatch) -> None:
    """The verifier once counted in sixteenths of a degree: the same cells then came in another order."""
    fine = quadrangle().starts(np.random.default_rng(0), 20)
    for module in (cells, start_set, slab):
        monkeypatch.setattr(module, "TURN", 360 * 16)
    monkeypatch.setattr(slab, "UNIT", np.radians(1 / 16))
    monkeypatch.setattr(StartSet.__init__, "__kwdefaults__", {"width": 8})
    np.testing.assert_allclose(quadrangle().starts(np.random.default_rng(0), 20), fine, atol=1e-12)
