"""What this package can read, solve, check and draw: one row per problem kind.

Functions are named as "module:function" and imported when first called, so that a checker never loads a solver.

A kind's `format` module has
    read(data) -> (task, options)            the whole file as a mapping; raises InvalidProblem
    answer_fields(problem, answer) -> dict   status first, then whatever the kind documents; plain JSON values
    read_answer(problem, data) -> answer     the same mapping, checked
and the other entries are
    solve(task, **options) -> answer         the answer has a `status`
    verify(task, answer) -> Report           answer is None for a problem file
    draw(task, answer, path)                 picture or animation by the suffix of path; draw(..., view=name) where it has views
"""

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

from expert.errors import InvalidProblem


class Report(Protocol):
    """What a checker answers."""

    @property
    def verdict(self) -> str:
        """sound, caged, certified, refuted, escapes or unknown."""

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON values, the certificate."""

    def __str__(self) -> str:
        """Lines for a reader."""


@dataclass(frozen=True, kw_only=True)
class Kind:
    """Where the code of one problem kind lives.

    solved: statuses that count as success.  views: parts of its picture that can be drawn alone; such a kind also draws
    problem files that state what there is to draw.
    """

    format: str
    solve: str
    verify: str
    draw: str
    solved: tuple[str, ...] = ("optimal",)
    views: tuple[str, ...] = ()

    def function(self, role: str) -> Callable[..., Any]:
        """Import what this kind uses to `solve`, `verify` or `draw`, or a function of its `format` module."""
        entry = getattr(self, role) if role in ("solve", "verify", "draw") else f"{self.format}:{role}"
        module, _, name = entry.partition(":")
        return getattr(importlib.import_module(module), name)


KINDS: dict[str, Kind] = {
    "contact_trajectory": Kind(
        format="expert.files.contact_trajectory",
        solve="expert.contact:solve",
        verify="expert.verify.plan.check:verify",
        draw="expert.drawing.contact_trajectory:draw",
    ),
    "cage": Kind(
        format="expert.files.cage",
        solve="expert.caging.synthesis:solve",
        verify="expert.verify.cage.check:verify",
        draw="expert.drawing.cage:draw",
        solved=("caged",),
        views=("all", "workspace", "slice", "component"),
    ),
    "certified_grasp": Kind(
        format="expert.files.certified_grasp",
        solve="expert.grasping.synthesis:solve",
        verify="expert.verify.grasp.check:verify",
        draw="expert.drawing.certified_grasp:draw",
        solved=("certified",),
    ),
}


def kind_named(name: object, field: str) -> Kind:
    """The row of a kind.  Raises InvalidProblem, naming `field`, for a kind that does not exist."""
    if not isinstance(name, str) or name not in KINDS:
        raise InvalidProblem(field, expected=" or ".join(KINDS), got=repr(name)[:60])
    return KINDS[name]
