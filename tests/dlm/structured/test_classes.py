import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dlm.structured.classes import MEASURED, Schedules, shares
from expert.errors import InvalidProblem
from expert.problems.contact import FREE

SCHEDULES = Schedules()


@given(st.integers(3, 12), st.randoms(use_true_random=False), st.booleans())
def test_a_class_survives_its_modes_in_any_order_of_the_fingers(facets: int, random, swapped: bool) -> None:
    classes = SCHEDULES.classes(facets)
    k = random.randrange(len(classes))
    modes = SCHEDULES.modes(classes[k : k + 1])[0]
    assert SCHEDULES.class_of(modes[:, ::-1] if swapped else modes) == tuple(classes[k])


def test_no_two_classes_are_the_same_contacts() -> None:
    classes = SCHEDULES.classes(5)
    contacts = {tuple(sorted(map(tuple, modes.T))) for modes in SCHEDULES.modes(classes)}
    assert len(contacts) == len(classes)
    everything = {
        tuple(sorted([tuple(np.where(u, a, FREE)), tuple(np.where(v, b, FREE))]))
        for u, v in SCHEDULES.touching.swapaxes(1, 2)
        for a in range(5)
        for b in range(5)
    }
    assert contacts == everything


def test_what_the_vocabulary_lacks_has_no_class() -> None:
    alternating = np.array([[0, 1], [FREE, 1], [0, 1], [0, 1], [0, 1]])
    changing = np.array([[0, 1], [0, 1], [FREE, 1], [2, 1], [2, 1]])
    assert SCHEDULES.class_of(alternating) is None
    assert SCHEDULES.class_of(changing) is None
    assert shares([alternating, changing, changing, changing]) == {
        "a finger changes facets": 0.75,
        "x.xxx xxxxx": 0.25,
    }


@pytest.mark.parametrize(
    "patterns", [(), ("xx",), ("xxx xx",), ("abc xyz",), ("xx xx", "xx xx"), ("x. xx", "xx x.")]
)
def test_words_that_are_no_schedules_are_refused(patterns: tuple[str, ...]) -> None:
    with pytest.raises(InvalidProblem, match="schedules"):
        Schedules(patterns)


def test_the_measured_vocabulary_names_each_schedule_once() -> None:
    assert len(set(Schedules(MEASURED).patterns)) == len(MEASURED) == 8
