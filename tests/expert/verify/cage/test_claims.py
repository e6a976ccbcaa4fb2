"""What an answer claims beyond caging: the orientations that are kept, and the cost."""

from dataclasses import replace

import numpy as np
import pytest

from expert.problems.cage import CageProblem, CageSolution
from expert.verify.cage.check import verify, verify_cage
from expert.world.named import named_shape
from expert.world.shape import Shape

PROBLEM = CageProblem(shape=Shape(vertices=named_shape("hourglass")), pose=np.array([0.1, 0.0, 0.4]), count=2)
TURN = np.array([[np.cos(0.4), np.sin(0.4)], [-np.sin(0.4), np.cos(0.4)]])
FINGERS = np.array([0.1, 0.0]) + np.array([[-0.02, 0], [0.02, 0]]) @ TURN
SHOWN = verify_cage(PROBLEM.arrangement(FINGERS)).rotation_range or (np.nan, np.nan)


def answer(**more: object) -> CageSolution:
    return CageSolution(status="caged", fingers=FINGERS, **more)  # type: ignore[arg-type]


def test_the_range_that_the_checker_shows_is_believed_and_so_is_a_wider_one() -> None:
    for wider in (0.0, 0.1):
        report = verify(PROBLEM, answer(rotation_range=(SHOWN[0] - wider, SHOWN[1] + wider)))
        assert report.verdict == "caged"
        assert report.rotation_range == pytest.approx(SHOWN)
    assert "topology" in report.claimed


def test_a_range_that_the_object_leaves_is_refuted() -> None:
    report = verify(PROBLEM, answer(rotation_range=(0.399, 0.401)))
    assert report.verdict == "refuted"
    assert "turns beyond" in report.reason


def test_a_range_that_is_a_little_too_narrow_is_not_shown() -> None:
    report = verify(PROBLEM, answer(rotation_range=(SHOWN[0] + 1e-5, SHOWN[1])))
    assert report.verdict in ("unknown", "refuted")


def test_a_cost_that_nobody_asked_for_is_refuted() -> None:
    assert verify(PROBLEM, answer(objective=1.0)).verdict == "refuted"
    dear = replace(PROBLEM, cost="min_separation")
    cost = float(((FINGERS[0] - FINGERS[1]) ** 2).sum())
    assert verify(dear, answer(objective=cost)).verdict == "caged"
    for share in (1e-4, 1.0):  # a cost may be small against the square of the object's size
        assert verify(dear, answer(objective=(1 + share) * cost)).verdict == "refuted"
