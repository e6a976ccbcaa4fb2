"""Tasks written as problem files are read back as they were."""

from dataclasses import fields, is_dataclass
from pathlib import Path

import numpy as np
import pytest

from expert.files import problem_of, read_problem
from expert.files.contact_task import task_fields
from expert.files.document import load, save

PROBLEMS = sorted((Path(__file__).parents[3] / "configs" / "problem" / "contact_trajectory").glob("*.yaml"))


def assert_same(a: object, b: object, path: str = "task") -> None:
    """Every field alike, arrays to the last rounding errors."""
    assert type(a) is type(b), path
    if is_dataclass(a):
        for field in fields(a):
            if field.name != "name":  # of a wall: only words
                assert_same(getattr(a, field.name), getattr(b, field.name), f"{path}.{field.name}")
    elif isinstance(a, np.ndarray):
        np.testing.assert_allclose(a, b, atol=1e-15, err_msg=path)
    elif isinstance(a, tuple) and isinstance(b, tuple):
        assert len(a) == len(b), path
        for k, (x, y) in enumerate(zip(a, b, strict=True)):
            assert_same(x, y, f"{path}[{k}]")
    else:
        assert a == b, path


@pytest.mark.parametrize("path", PROBLEMS, ids=lambda p: p.stem)
def test_a_task_survives_writing_and_reading(path: Path, tmp_path: Path) -> None:
    task = read_problem(path).task
    save(tmp_path / "again.json", task_fields(task, description="again"))
    assert_same(problem_of(load(tmp_path / "again.json")).task, task)


def test_there_are_problems_to_write() -> None:
    assert len(PROBLEMS) >= 10
