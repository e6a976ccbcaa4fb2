"""Objects in files: a polygon or convex pieces, its pose, with mass a body; and how a file numbers its facets and vertices."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import shapely

from expert.errors import InvalidProblem
from expert.files.section import SMALLEST, Section, checked_array, shorten
from expert.geometry.polygon import signed_area
from expert.geometry.pose import Array
from expert.world.shape import Body, Shape
from expert.world.values import IntArray


def read_shape(section: Section) -> Shape:
    """The shape of vertices, of convex pieces, or of both.  Raises InvalidProblem."""
    if "pieces" not in section:
        return Shape(vertices=_outline(section))
    listed, field = section.take("pieces", "a list of convex polygons"), section.path("pieces")
    if not isinstance(listed, list):
        raise InvalidProblem(field, expected="a list of convex polygons", got=shorten(listed))
    pieces = tuple(
        _sizeable(f"{field}[{k}]", checked_array(piece, (None, 2), f"{field}[{k}]"))
        for k, piece in enumerate(listed)
    )
    if "vertices" in section:
        return Shape(vertices=section.array("vertices", (None, 2)), given_pieces=pieces)
    return Shape.of_pieces(pieces)


def write_shape(shape: Shape) -> dict[str, Any]:
    """The section that `read_shape` reads."""
    pieces = [piece.tolist() for piece in shape.given_pieces]
    return {"vertices": shape.vertices.tolist(), **({"pieces": pieces} if pieces else {})}


def read_body(section: Section) -> tuple[Body, Array]:
    """Body about its centre of mass, and the centre of mass (2,) in the file's body frame.  Raises InvalidProblem."""
    stated = section.array("com", (2,)) if "com" in section else None
    body, com = Body.uniform(_outline(section), section.number("mass", positive=True), stated)
    if not shapely.MultiPoint(body.vertices).convex_hull.buffer(SMALLEST).covers(shapely.Point(0, 0)):
        raise InvalidProblem(
            section.path("com"), expected="a point inside the object's hull", got=shorten(com.tolist())
        )
    return (replace(body, inertia=section.number("inertia")) if "inertia" in section else body), com


def write_body(body: Body) -> dict[str, Any]:
    """The section that `read_body` reads."""
    about = {"mass": body.mass, "com": [0.0, 0.0], "inertia": body.inertia}
    return {"vertices": body.vertices.tolist(), **about}


def read_pose(file: Section) -> Array:
    """The object's pose (3,); the origin where the file states none."""
    return file.array("pose", (3,)) if "pose" in file else np.zeros(3)


def _outline(section: Section) -> Array:
    return _sizeable(section.path("vertices"), section.array("vertices", (None, 2)))


def _sizeable(field: str, points: Array) -> Array:
    """Points that do not almost coincide."""
    if len(points) and np.ptp(points, axis=0).max() < SMALLEST:
        raise InvalidProblem(field, expected=f"a polygon larger than {SMALLEST:g} m", got="a smaller one")
    return points


@dataclass(frozen=True)
class Numbering:
    """Facets and vertices as a file lists them, either way round, and counter-clockwise as inside the package.

    Both rules are their own inverse.
    """

    count: int
    clockwise: bool

    @classmethod
    def of(cls, data: dict[str, Any]) -> "Numbering":
        """That of a problem file whose object has vertices."""
        listed = np.array(data["object"]["vertices"], dtype=float)
        return cls(len(listed), bool(signed_area(listed) < 0))

    def vertex(self, index: int) -> int:
        """The same vertex in the other list."""
        return -index % self.count if self.clockwise else index

    def facets(self, indices: IntArray) -> IntArray:
        """The same facets in the other list; negative numbers, which stand for none, are kept."""
        return np.where(indices < 0, indices, self.count - 1 - indices) if self.clockwise else indices
