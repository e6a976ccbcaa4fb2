from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from datasets.parameters import MechanicalParameters, parameters_of
from datasets.render import render
from datasets.specification import Specification, draw
from datasets.store import read_dataset
from expert.errors import InvalidProblem


def test_a_stored_sample_is_the_drawn_one(small: Specification, made: Path) -> None:
    data = read_dataset(made)
    for i in (1, 5):
        read, (drawn, _) = data[i], draw(small, 0, i)
        assert (read.index, read.attempt, read.family) == (drawn.index, drawn.attempt, drawn.family)
        assert np.array_equal(read.video, drawn.video)
        assert read.task.fingers == drawn.task.fingers
        assert read.task.environment.gravity == drawn.task.environment.gravity
        assert read.task.robustness.min_normal_force == pytest.approx(
            drawn.task.robustness.min_normal_force, rel=1e-15
        )
        assert np.array_equal(read.task.body.vertices, drawn.task.body.vertices)
        assert np.array_equal(read.task.trajectory.extended, drawn.task.trajectory.extended)
        for name in ("status", "objective", "bound", "nodes", "residual"):
            assert getattr(read.plan, name) == getattr(drawn.plan, name), name
        for name in ("modes", "positions", "forces"):
            assert np.array_equal(getattr(read.plan, name), getattr(drawn.plan, name)), name
        assert len(read.plan.contact_forces) == len(drawn.plan.contact_forces) > 0
        for a, b in zip(read.plan.contact_forces, drawn.plan.contact_forces, strict=True):
            assert (a.step, a.vertex, a.wall) == (b.step, b.vertex, b.wall)
            assert np.array_equal([a.point, a.force], [b.point, b.force])


def test_parameters_and_videos_follow_from_the_stored_tasks_and_plans(made: Path) -> None:
    data = read_dataset(made)
    for i in range(len(data)):
        sample = data[i]
        again = parameters_of(sample.task, sample.plan)
        for f in fields(MechanicalParameters):
            assert np.allclose(getattr(again, f.name), getattr(sample.parameters, f.name), atol=1e-15), f.name
        assert np.array_equal(render(sample.task.body.vertices, sample.task.trajectory.poses), sample.video)


def test_a_stored_polygon_that_crosses_itself_or_negative_mass_makes_no_task(made: Path) -> None:
    data = read_dataset(made)
    data.arrays["mass"][0] = -1.0
    with pytest.raises(InvalidProblem, match=r"object.mass: expected a positive number, got -1.0"):
        data[0]
    data.arrays["vertices"][1, [1, 2]] = data.arrays["vertices"][1, [2, 1]]
    with pytest.raises(InvalidProblem, match=r"object.vertices: expected a simple polygon"):
        data[1]
