"""A problem in Python: built, solved, verified, drawn, saved and loaded, under the same keys and defaults as in its file."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from certmanip.notebook import page
from expert.commands import read_either
from expert.errors import InvalidProblem
from expert.files import FORMATS, SCHEMA, Problem, problem_for, problem_of, write_problem, write_solution
from expert.files.document import load as load_document
from expert.files.grippers import write_grippers
from expert.files.objects import write_body, write_shape
from expert.files.section import plain_values
from expert.files.walls import write_walls
from expert.kinds import KINDS
from expert.problems.contact import Cost, Robustness
from expert.shipped import located
from expert.verify.report import Report
from expert.world.fingers import Fingers, Gripper
from expert.world.shape import Body, Shape
from expert.world.walls import HalfPlane, Obstacle, Segment

Section = Mapping[str, Any]
"""A section of a problem file: docs/files.md has its keys; arrays and nouns may stand for lists and mappings."""
Outline = Section | Shape | ArrayLike
"""An object: its vertices (V, 2) [m], a shape, or the whole section."""
Path = str | os.PathLike[str]


@dataclass(frozen=True, kw_only=True, repr=False)
class Case:
    """A problem and, once it is solved, the answer to it.  In a notebook it shows its picture and what the checker says."""

    problem: Problem
    answer: Any = None

    @property
    def kind(self) -> str:
        """contact_trajectory, cage, certified_grasp or push."""
        return self.problem.kind

    @property
    def task(self) -> Any:
        """The problem as nouns: ContactTask, CageProblem, Arrangement, GraspProblem or PushProblem."""
        return self.problem.task

    @property
    def status(self) -> str:
        """The answer's; `stated` for fingers that are given, `open` for what is yet to be solved."""
        if self.answer is not None:
            return str(self.answer.status)
        return "stated" if "positions" in self.problem.data.get("fingers", {}) else "open"

    def solve(self, **options: Any) -> "Case":
        """The same with an answer.  options: those of the file, `time_limit` [s], `method`, ...  Raises InvalidProblem, SolverFailed."""
        if self.status == "stated":
            what = "the number of fingers to find"
            raise InvalidProblem("fingers", expected=what, got="their positions", remedy="verify it instead")
        data = self.problem.data
        stated = {**(data.get("options") or {}), **options}
        problem = problem_of({**data, "options": _plain(stated)}) if options else self.problem
        return Case(problem=problem, answer=KINDS[self.kind].solve(problem.task, **problem.options))

    def verify(self) -> Report:
        """What the independent checker says of the answer, or of given fingers.  Raises InvalidProblem where nothing is claimed."""
        return self._report

    @cached_property
    def _report(self) -> Report:
        return KINDS[self.kind].verify(self.task, self.answer)

    def draw(self, path: Path, view: str | None = None) -> None:
        """Picture (.png, .svg, .pdf) or animation (.gif, .mp4).  view: of a cage, `workspace`, `slice` or `component`."""
        KINDS[self.kind].draw(self.task, self.answer, path, view)

    def save(self, path: Path) -> None:
        """Write a solution file, or a problem file where there is no answer: JSON, all or nothing."""
        if self.answer is None:
            write_problem(path, self.problem)
        else:
            write_solution(path, self.problem, self.answer)

    def __repr__(self) -> str:
        return f"<{self.kind}: {self.status}>"

    def _repr_html_(self) -> str:
        return page(self)


def load(path: Path) -> Case:
    """The problem or solution file of that name; `shipped:cage/t_4`: a problem that comes along.  Raises InvalidProblem."""
    return case(load_document(located(path)))


def case(content: Any, **options: Any) -> Case:
    """A case of a mapping as files hold it, or of a task made of nouns, with options for its solver.  Raises InvalidProblem."""
    if not isinstance(content, Mapping):
        return Case(problem=problem_for(content, **options))
    problem, answer = read_either(dict(content))
    return Case(problem=problem, answer=answer)


def contact_trajectory(
    *,
    object: Outline,
    environment: Section,
    trajectory: Section,
    fingers: Section | Fingers,
    cost: Section | Cost | None = None,
    robustness: Section | Robustness | None = None,
    options: Section | None = None,
) -> Case:
    """Where and with what forces do fingers make a motion (Thesis 3.1)?  Keys and defaults as in files; raises InvalidProblem."""
    return _of_sections("contact_trajectory", locals())


def cage(
    *,
    object: Outline,
    fingers: Section,
    pose: ArrayLike | None = None,
    walls: Sequence[Section | Segment] | None = None,
    cost: str | None = None,
    options: Section | None = None,
) -> Case:
    """Where do fingers stand so that the object cannot leave, or do given ones hold it (Thesis 5.1)?  As `contact_trajectory`."""
    return _of_sections("cage", locals())


def certified_grasp(
    *,
    object: Outline,
    pose: ArrayLike | None = None,
    fingers: Section | None = None,
    cost: str | None = None,
    options: Section | None = None,
) -> Case:
    """Which finger paths bring every start of a set into one grasp (Thesis 5.2)?  As `contact_trajectory`."""
    return _of_sections("certified_grasp", locals())


def push(
    *,
    object: Outline,
    start: ArrayLike,
    goal: ArrayLike,
    finger: Section,
    limit_surface: Section | None = None,
    tolerance: Section | None = None,
    obstacles: Sequence[Section | Obstacle] | None = None,
    workspace: ArrayLike | None = None,
    clearance: float | None = None,
    options: Section | None = None,
) -> Case:
    """Which straight pushes of one finger bring the object on a table to its goal?  As `contact_trajectory`."""
    return _of_sections("push", locals())


def _of_sections(kind: str, sections: Mapping[str, Any]) -> Case:
    """The case whose file has these sections; those that are None are left out."""
    given = {key: _plain(sections[key]) for key in FORMATS[kind].KEYS if sections[key] is not None}
    if not isinstance(given["object"], dict):
        given["object"] = {"vertices": given["object"]}
    return Case(problem=problem_of({"schema": SCHEMA, "problem": kind, **given}))


def _plain(value: Any) -> Any:
    """What a file would hold in its place."""
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, Shape):
        return write_body(value) if isinstance(value, Body) else write_shape(value)
    if isinstance(value, HalfPlane | Segment | Obstacle):
        return write_walls([value])[0]
    if isinstance(value, Gripper):
        return write_grippers([value])[0]
    if isinstance(value, Fingers | Cost | Robustness):
        return plain_values(value)
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return [_plain(item) for item in value] if isinstance(value, list | tuple) else value
