"""Polygons as objects: a shape and its convex pieces, and with mass a rigid body."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely

from expert.geometry.convex import convex_pieces
from expert.geometry.polygon import (
    diameter,
    facet_frames,
    facets,
    is_convex,
    mass_properties,
    simple_polygon,
)
from expert.geometry.pose import Array, rotation, to_world
from expert.world.values import require

COVER_TOLERANCE = 1e-9
"""Given pieces may miss or exceed the object's area by this fraction."""


@dataclass(frozen=True, kw_only=True)
class Shape:
    """Polygon (V, 2) [m, body frame], counter-clockwise, facet k from vertex k to k + 1.

    given_pieces: convex polygons ((v, 2), ...) that cover exactly it, if they are known.
    Raises InvalidProblem for pieces that are not convex, reach outside, or leave parts uncovered.
    """

    vertices: Array
    given_pieces: tuple[Array, ...] = ()

    def __post_init__(self) -> None:
        vertices = simple_polygon(self.vertices, field="object.vertices")
        pieces = tuple(_convex_piece(p, k) for k, p in enumerate(self.given_pieces))
        if pieces:
            _require_cover(shapely.Polygon(vertices), pieces)
        for array in (vertices, *pieces):
            array.setflags(write=False)
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "given_pieces", pieces)

    @classmethod
    def of_pieces(cls, pieces: Sequence[object]) -> "Shape":
        """The union of convex pieces.  Raises InvalidProblem where it has a hole or falls apart."""
        require(len(pieces) > 0, "object.pieces", "at least one convex polygon", "none")
        checked = [_convex_piece(p, k) for k, p in enumerate(pieces)]
        size = diameter(np.concatenate(checked))
        grid = 1e-10 * size  # corners are put on it first: a union alone that does so may leave slivers
        snapped = shapely.set_precision([shapely.Polygon(p) for p in checked], grid)
        parts = shapely.get_parts(shapely.union_all(snapped, grid_size=grid))
        what = "pieces whose union is one polygon"
        require(
            len(parts) == 1, "object.pieces", what, "parts that do not join along edges", "let them overlap"
        )
        holes = len(parts[0].interiors)
        require(
            holes == 0, "object.pieces", what, f"{holes} hole(s) in it", "a caged object must have no hole"
        )
        outline = shapely.simplify(parts[0], 1e-9 * size).exterior
        return cls(vertices=np.array(outline.coords)[:-1], given_pieces=tuple(checked))

    @cached_property
    def pieces(self) -> tuple[Array, ...]:
        """Convex polygons ((v, 2), ...) whose union the shape is: those given, or a partition."""
        if self.given_pieces:
            return self.given_pieces
        pieces = tuple(simple_polygon(p, field="object.pieces") for p in convex_pieces(self.vertices))
        _require_cover(shapely.Polygon(self.vertices), pieces)
        for piece in pieces:
            piece.setflags(write=False)
        return pieces

    @cached_property
    def size(self) -> float:
        """Characteristic length L: the diameter [m]."""
        return diameter(self.vertices)

    def facets_w(self, pose: Array) -> tuple[Array, Array]:
        """End points a, b of all facets in the world frame at poses (..., 3), each (..., V, 2)."""
        a, b = facets(self.vertices)
        return to_world(pose, a), to_world(pose, b)

    def frames_w(self, pose: Array) -> tuple[Array, Array]:
        """Inward normals and tangents of all facets in the world frame at poses (..., 3), each (..., V, 2)."""
        turn = np.swapaxes(rotation(np.asarray(pose)[..., 2]), -1, -2)
        normal, tangent = facet_frames(self.vertices)
        return normal @ turn, tangent @ turn


@dataclass(frozen=True, kw_only=True)
class Body(Shape):
    """Rigid body: a shape whose frame's origin is the centre of mass; mass [kg], inertia [kg m^2] about the origin."""

    mass: float
    inertia: float

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("mass", "inertia"):
            value = getattr(self, name)
            require(0 < value < np.inf, f"object.{name}", "a positive number", value)

    @classmethod
    def uniform(cls, vertices: object, mass: float, com: Array | None = None) -> tuple["Body", Array]:
        """Body of uniform density and its centroid (2,) in the frame of the given vertices.

        Where another centre of mass com (2,) is stated, the inertia is the uniform plate's about it.
        """
        v = simple_polygon(vertices, field="object.vertices")
        plate = mass_properties(v)
        require(0 < mass < np.inf, "object.mass", "a positive number", mass)
        centre = plate.centroid if com is None else com
        offset = centre - plate.centroid
        inertia = mass * (plate.second_moment / plate.area + float(offset @ offset))
        return cls(vertices=v - centre, mass=mass, inertia=inertia), centre


def _convex_piece(vertices: object, k: int) -> Array:
    name = f"object.pieces[{k}]"
    piece = simple_polygon(vertices, field=name)
    require(is_convex(piece), name, "a convex polygon", "a reflex corner", "split it")
    return piece


def _require_cover(polygon: shapely.Polygon, pieces: tuple[Array, ...]) -> None:
    """Pieces must neither miss a part of the object nor reach outside: a bad cover makes false cages."""
    union = shapely.union_all([shapely.Polygon(p) for p in pieces])
    for excess, complaint in (
        (union.difference(polygon), "pieces that reach outside it"),
        (polygon.difference(union), "pieces that do not cover it"),
    ):
        small = excess.area <= COVER_TOLERANCE * polygon.area
        require(small, "object.pieces", "a cover of the object", f"{complaint} by {excess.area:.3g} m^2")
