"""Problem and solution files: the public formats, which docs/files.md describes key by key."""

import os
from dataclasses import dataclass
from typing import Any

from expert.errors import InvalidProblem
from expert.files.document import load, save
from expert.kinds import Kind, kind_named

__all__ = [
    "SCHEMA",
    "Problem",
    "Solution",
    "problem_of",
    "read_problem",
    "read_solution",
    "solution_of",
    "write_solution",
]

SCHEMA = 1


@dataclass(frozen=True, kw_only=True)
class Problem:
    """A problem file that was read: its kind, the whole file, the task in it and keyword options for its solver."""

    kind: str
    data: dict[str, Any]
    task: Any
    options: dict[str, Any]

    @property
    def entry(self) -> Kind:
        """Where the code of this kind lives."""
        return kind_named(self.kind, "problem")


@dataclass(frozen=True, kw_only=True)
class Solution:
    """A solution file that was read: the problem it repeats and the answer to it."""

    problem: Problem
    answer: Any


def read_problem(path: str | os.PathLike[str]) -> Problem:
    """Read a YAML or JSON problem file of any kind.  Raises InvalidProblem, one line, for whatever is wrong with it."""
    return problem_of(load(path))


def problem_of(data: dict[str, Any]) -> Problem:
    """The problem that a mapping describes.  Raises InvalidProblem."""
    _check_schema(data, "problem")
    kind = kind_named(data["problem"], "problem")
    task, options = kind.function("read")(data)
    return Problem(kind=data["problem"], data=data, task=task, options=options)


def write_solution(path: str | os.PathLike[str], problem: Problem, answer: Any) -> None:
    """Write problem and answer as one JSON file, atomically."""
    save(path, _solution_fields(problem, answer))


def read_solution(path: str | os.PathLike[str]) -> Solution:
    """Read a solution file.  Raises InvalidProblem."""
    return solution_of(load(path))


def solution_of(data: dict[str, Any]) -> Solution:
    """The solution that a mapping describes.  Raises InvalidProblem."""
    _check_schema(data, "solution")
    kind = kind_named(data["solution"], "solution")
    if not isinstance(data.get("problem"), dict):
        raise InvalidProblem("problem", expected="the whole problem file", got=repr(data.get("problem"))[:60])
    problem = problem_of(data["problem"])
    if problem.kind != data["solution"]:
        raise InvalidProblem("solution", expected=f"{problem.kind}, as its problem", got=data["solution"])
    answer = {key: value for key, value in data.items() if key not in ("schema", "solution", "problem")}
    return Solution(problem=problem, answer=kind.function("read_answer")(problem, answer))


def _solution_fields(problem: Problem, answer: Any) -> dict[str, Any]:
    fields = problem.entry.function("answer_fields")(problem, answer)
    return {"schema": SCHEMA, "solution": problem.kind, "problem": problem.data, **fields}


def _check_schema(data: dict[str, Any], title: str) -> None:
    schema = data.get("schema")
    if isinstance(schema, bool) or schema != SCHEMA:
        raise InvalidProblem(
            "schema", expected=f"{SCHEMA}", got=repr(schema)[:60], remedy=f"begin with schema: {SCHEMA}"
        )
    if title not in data:
        raise InvalidProblem(title, expected=f"the kind of {title}", got="nothing", remedy="add the field")
