"""What an answer claims beyond its path: jaws that stay parallel, the cost, the starts."""

from dataclasses import replace

import numpy as np
import pytest

from expert.geometry.polygon import signed_area
from expert.problems.grasp import GraspProblem, GraspSolution
from expert.verify.grasp.check import verify
from expert.world.fingers import Gripper
from expert.world.shape import Shape

SLAB = np.array([[-0.05, -0.03], [0.05, -0.03], [0.05, 0.03], [-0.05, 0.03]])
PATH = np.array([
    [[0.02, -0.032], [0.052, -0.015], [-0.02, 0.032], [-0.052, 0.015]],
    [[0.02, -0.031], [0.051, -0.015], [-0.02, 0.031], [-0.051, 0.015]],
    [[0.02, -0.030], [0.050, -0.015], [-0.02, 0.030], [-0.050, 0.015]],
])  # fmt: skip
"""Certified fingers; those on the long sides are seen from each other at 122 degrees."""
STARTS = 0.0015 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


def problem(**more: object) -> GraspProblem:
    return GraspProblem(
        shape=Shape(vertices=SLAB), pose=np.zeros(3), half_ranges=np.radians([15, 10, 5]), count=4, **more
    )  # type: ignore[arg-type]


def answer(**more: object) -> GraspSolution:
    return GraspSolution(status="uncertified", path=PATH, **more)  # type: ignore[arg-type]


def test_jaws_at_122_degrees_are_not_parallel() -> None:
    jaws = (Gripper(fingers=(0, 2), opening=(0.0, 0.2)),)
    assert verify(problem(grippers=jaws), answer()).verdict == "certified"
    report = verify(problem(grippers=jaws, parallel=True), answer())
    assert report.verdict == "refuted"
    assert "not parallel" in report.reason


def test_starts_are_believed_where_they_are_in_q0() -> None:
    area = abs(signed_area(STARTS))
    report = verify(problem(), answer(starts=STARTS, objective=area))
    assert report.verdict == "certified"
    assert report.claimed == ("method", "seconds", "refuted", "reason")


@pytest.mark.parametrize("scale", [1.5, 20])
def test_starts_that_fingers_are_inside_of_are_refuted(scale: float) -> None:
    report = verify(problem(), answer(starts=scale * STARTS))
    assert report.verdict == "refuted"
    assert "inside the object" in report.reason


def test_starts_elsewhere_are_not_shown_to_be_held() -> None:
    report = verify(problem(), answer(starts=STARTS + [0.3, 0.0]))
    assert report.verdict == "unknown"
    assert "not shown to be in Q0" in report.reason


def test_another_cost_is_refuted() -> None:
    area = abs(signed_area(STARTS))
    assert "the cost is" in verify(problem(), answer(starts=STARTS, objective=400 * area)).reason
    smooth = problem(cost="acceleration")
    cost = float((np.diff(PATH, 2, axis=0) ** 2).sum())
    assert verify(smooth, answer(objective=cost)).verdict == "certified"
    for excess in (1e-9, 1e-3):  # far below the square of the object's size, but this path is straight
        assert verify(smooth, replace(answer(), objective=cost + excess)).verdict == "refuted"
