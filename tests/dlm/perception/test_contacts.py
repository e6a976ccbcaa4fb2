import numpy as np

from dlm.perception.contacts import snap_contacts
from dlm.perception.fit import (
    MovingPolygon,
    fit,
)
from expert.geometry.pose import rotation
from tests.support.moving_polygon import PENTAGON, TRUTH, observed


def test_contacts_are_exact_and_nothing_enters_the_floor() -> None:
    """A pivot about the right end of the side at rest: it stays where it is."""
    corner = PENTAGON[1]
    motion = np.zeros((3, 3))
    for t, angle in enumerate([0.0, -0.15, -0.4]):
        shift = corner - TRUTH.centre - rotation(angle) @ (corner - TRUTH.centre)
        motion[t] = [*shift, angle]
    seen = observed(MovingPolygon(PENTAGON, motion, TRUTH.centre), deviation=0.03)
    rough, _ = fit(MovingPolygon(PENTAGON + 0.05, motion, TRUTH.centre), seen)
    found = snap_contacts(rough, seen, floor=6.0, reach=0.25).placed()
    assert np.abs(found[0, :2, 1] - 6).max() < 1e-8
    assert np.abs(found[:, 1] - found[0, 1]).max() < 1e-8
    assert found[..., 1].min() > 6 - 1e-8
    assert found[1, 0, 1] > 6.5


def test_a_gap_that_the_data_shows_stays() -> None:
    motion = np.array([[0.0, 0.0, 0.0], [0.0, 0.2, 0.0]])
    seen = observed(MovingPolygon(PENTAGON, motion, TRUTH.centre))
    found = snap_contacts(MovingPolygon(PENTAGON, motion, TRUTH.centre), seen, floor=6.0, reach=0.25).placed()
    assert np.abs(found[0, :2, 1] - 6).max() < 1e-8
    assert np.abs(found[1, :2, 1] - 6.2).max() < 0.03
