"""Walls in files: {point, normal, friction} a half-plane, {from, to, friction} a segment, {vertices, friction} a polygon."""

from collections.abc import Collection, Iterable
from typing import Any

import numpy as np

from expert.errors import InvalidProblem
from expert.files.section import SMALLEST, Section
from expert.world.walls import HalfPlane, Obstacle, Segment, Wall

FORMS: dict[type, tuple[str, tuple[str, ...]]] = {
    HalfPlane: ("a half-plane", ("point", "normal")),
    Segment: ("a segment", ("from", "to")),
    Obstacle: ("a polygon", ("vertices",)),
}
"""By noun: what it is called, and the keys that tell it from the others."""
KEYS = (*(key for _, keys in FORMS.values() for key in keys), "friction")


def read_walls(section: Section, key: str, accepted: Collection[type]) -> tuple[Any, ...]:
    """The list of walls under a key; none where it is missing.  Raises InvalidProblem for kinds that are not accepted."""
    return tuple(_read(wall, accepted) for wall in section.sections(key, KEYS))


def _read(section: Section, accepted: Collection[type]) -> Wall:
    known = " or ".join(_described(form) for form in accepted)
    forms = [form for form, (_, keys) in FORMS.items() if any(key in section for key in keys)]
    if len(forms) != 1:
        got = " and ".join(FORMS[form][0] for form in forms) if forms else "none of these keys"
        raise InvalidProblem(section.name, expected=known, got=got)
    (form,) = forms
    if form not in accepted:
        remedy = "this kind of problem knows no other walls yet"
        raise InvalidProblem(section.name, expected=known, got=_described(form), remedy=remedy)
    common = {"name": section.name, **section.values(form, ("friction",))}
    if form is HalfPlane:
        return HalfPlane(point=section.array("point", (2,)), normal=_direction(section), **common)
    if form is Segment:
        return Segment(ends=np.stack([section.array("from", (2,)), section.array("to", (2,))]), **common)
    return Obstacle(vertices=section.array("vertices", (None, 2)), **common)


def _direction(section: Section) -> np.ndarray:
    """The unit normal; files may state it with any length."""
    normal = section.array("normal", (2,))
    length = float(np.linalg.norm(normal))
    if length < SMALLEST:
        raise InvalidProblem(
            section.path("normal"), expected="a direction into free space", got="a zero vector"
        )
    return normal / length


def _described(form: type) -> str:
    name, keys = FORMS[form]
    return f"{name} {{{', '.join(keys)}}}"


def write_walls(walls: Iterable[Wall]) -> list[dict[str, Any]]:
    """The list that `read_walls` reads."""
    return [{**_places(wall), "friction": wall.friction} for wall in walls]


def _places(wall: Wall) -> dict[str, Any]:
    if isinstance(wall, HalfPlane):
        return {"point": wall.point.tolist(), "normal": wall.normal.tolist()}
    if isinstance(wall, Segment):
        return {"from": wall.ends[0].tolist(), "to": wall.ends[1].tolist()}
    return {"vertices": wall.vertices.tolist()}
