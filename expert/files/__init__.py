"""Problem and solution files: the public formats, which docs/files.md describes key by key."""

import os
from typing import Any, Protocol

from expert.errors import InvalidProblem
from expert.files import cage, certified_grasp, contact_trajectory, push
from expert.files.document import load, save
from expert.files.problem import Problem, Solution
from expert.files.section import Section

__all__ = [
    "FORMATS",
    "SCHEMA",
    "Problem",
    "Solution",
    "problem_for",
    "problem_of",
    "read_problem",
    "read_solution",
    "solution_fields",
    "solution_of",
    "write_problem",
    "write_solution",
]

SCHEMA = 1


class Format(Protocol):
    """What the module of one kind has: the keys of its files, and the way from each key to the task or answer and back."""

    TASKS: tuple[type, ...]
    """Classes of its tasks."""
    OPTIONS: type
    """Dataclass of its solver's options."""
    KEYS: tuple[str, ...]
    """Of a problem file, beside those that every file has."""
    ANSWER_KEYS: tuple[str, ...]
    """Of a solution file, likewise."""

    def read(self, file: Section) -> tuple[Any, dict[str, Any]]:
        """Task, and options that were stated."""

    def write(self, task: Any) -> dict[str, Any]:
        """The mapping that reads as this task."""

    def answer_fields(self, problem: Problem, answer: Any) -> dict[str, Any]:
        """The answer as plain JSON values, its status first."""

    def read_answer(self, problem: Problem, file: Section) -> Any:
        """The answer that these fields state."""


FORMATS: dict[str, Format] = {
    "contact_trajectory": contact_trajectory,
    "cage": cage,
    "certified_grasp": certified_grasp,
    "push": push,
}


def read_problem(path: str | os.PathLike[str]) -> Problem:
    """Read a YAML or JSON problem file of any kind.  Raises InvalidProblem, one line, for whatever is wrong with it."""
    return problem_of(load(path))


def problem_of(data: dict[str, Any]) -> Problem:
    """The problem that a mapping describes.  Raises InvalidProblem."""
    kind = _kind(data, "problem")
    file = Section(data, "", ("schema", "problem", "description", *FORMATS[kind].KEYS))
    if "description" in file:
        file.text("description")
    task, stated = FORMATS[kind].read(file)
    options = FORMATS[kind].OPTIONS(**stated)
    return Problem(kind=kind, data=data, task=task, options=dict(vars(options)))


def problem_for(task: Any, *, description: str = "", **options: Any) -> Problem:
    """The problem file of a task that was made in Python, with options for its solver.  Raises InvalidProblem."""
    for kind, form in FORMATS.items():
        if isinstance(task, form.TASKS):
            data = {"schema": SCHEMA, "problem": kind, "description": description, **form.write(task)}
            return problem_of(
                {**data, "options": {**data.get("options", {}), **options}} if options else data
            )
    known = " or ".join(task.__name__ for form in FORMATS.values() for task in form.TASKS)
    raise InvalidProblem("task", expected=known, got=type(task).__name__)


def write_problem(path: str | os.PathLike[str], problem: Problem) -> None:
    """Write a problem as a JSON file, atomically."""
    save(path, problem.data)


def write_solution(path: str | os.PathLike[str], problem: Problem, answer: Any) -> None:
    """Write problem and answer as one JSON file, atomically."""
    save(path, solution_fields(problem, answer))


def solution_fields(problem: Problem, answer: Any) -> dict[str, Any]:
    """What a solution file holds: the problem and the answer to it."""
    fields = FORMATS[problem.kind].answer_fields(problem, answer)
    return {"schema": SCHEMA, "solution": problem.kind, "problem": problem.data, **fields}


def read_solution(path: str | os.PathLike[str]) -> Solution:
    """Read a solution file.  Raises InvalidProblem."""
    return solution_of(load(path))


def solution_of(data: dict[str, Any]) -> Solution:
    """The solution that a mapping describes.  Raises InvalidProblem."""
    kind = _kind(data, "solution")
    if not isinstance(data.get("problem"), dict):
        raise InvalidProblem("problem", expected="the whole problem file", got=repr(data.get("problem"))[:60])
    problem = problem_of(data["problem"])
    if problem.kind != kind:
        raise InvalidProblem("solution", expected=f"{problem.kind}, as its problem", got=kind)
    file = Section(data, "", ("schema", "solution", "problem", *FORMATS[kind].ANSWER_KEYS))
    return Solution(problem=problem, answer=FORMATS[kind].read_answer(problem, file))


def _kind(data: dict[str, Any], title: str) -> str:
    """The kind that the header names."""
    schema = data.get("schema")
    if isinstance(schema, bool) or schema != SCHEMA:
        remedy = f"begin with schema: {SCHEMA}"
        raise InvalidProblem("schema", expected=f"{SCHEMA}", got=repr(schema)[:60], remedy=remedy)
    if title not in data:
        raise InvalidProblem(title, expected=f"the kind of {title}", got="nothing", remedy="add the field")
    kind = data[title]
    if not isinstance(kind, str) or kind not in FORMATS:
        raise InvalidProblem(title, expected=" or ".join(FORMATS), got=repr(kind)[:60])
    return kind
