"""The compiled loop: its events say where contacts touch, and a full buffer shows."""

import numpy as np
import pytest

from expert.geometry.pose import rotation
from expert.verify.grasp.event_kernel import EVENT, TOUCH, Candidates, closing_contacts
from expert.verify.grasp.finger_path import Facets

BOX = np.array([[-0.8, -0.4], [0.8, -0.4], [0.8, 0.4], [-0.8, 0.4]])
SQUEEZE = np.array([[[0.2, -1.2], [0.2, 1.2]], [[0.2, 0.0], [0.2, 0.0]]])
"""Two fingers that come from 2.4 apart to the same point."""


def candidates() -> Candidates:
    contacts = np.array([(i, j) for i in range(2) for j in range(4)])
    compatible = contacts[:, None, 0] != contacts[None, :, 0]
    return Candidates(contacts, compatible, Facets.of(BOX), SQUEEZE)


def test_events_say_when_two_fingers_are_as_far_apart_as_two_sides() -> None:
    events = np.empty(50, EVENT)
    found = events[: closing_contacts(candidates(), events)]
    assert sorted(found["fraction"]) == pytest.approx([1 - 1.6 / 2.4] * 2 + [1 - 0.8 / 2.4] * 2)
    assert found["slides"].all()
    for event in found:
        fingers = SQUEEZE[0] + event["fraction"] * (SQUEEZE[1] - SQUEEZE[0])
        for slide in (event["slide_from"], event["slide_to"]):
            place = np.array([event["x"], event["y"]]) + slide * np.array(
                [event["slide_x"], event["slide_y"]]
            )
            seen = np.abs((fingers - place) @ rotation(event["angle"]))
            assert (
                seen <= [0.8 + 2 * TOUCH, 0.4 + 2 * TOUCH]
            ).all()  # on the box, whose sides it slides along
        assert event["count"] == 2
        assert event["clear"] > 0.1


@pytest.mark.parametrize("room", [0, 1, 3])
def test_a_full_buffer_shows(room: int) -> None:
    assert closing_contacts(candidates(), np.empty(room, EVENT)) == room
