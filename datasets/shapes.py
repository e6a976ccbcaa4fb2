"""Random polygonal objects, as a camera can tell them apart and a floor can bear them."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import shapely

from expert.errors import InvalidProblem
from expert.geometry.polygon import crossing_edges, diameter, facets, mass_properties, signed_area
from expert.geometry.pose import Array, cross, rotation
from expert.world.values import readonly, require

ATTEMPTS = 10_000
STABLE_SHARE = 0.15
"""The weight of an object at rest falls at least this share of the side's length inside it."""


class ShapeFamily(Protocol):
    """What a data set asks of its distribution of shapes: least and greatest number of facets, and range of diameters [m]."""

    @property
    def facets(self) -> tuple[int, int]: ...

    @property
    def diameter(self) -> tuple[float, float]: ...

    def sample(self, rng: np.random.Generator) -> Array:
        """Counter-clockwise vertices (V, 2) [m] about the centroid."""


def check_diameter(diameter: object) -> tuple[float, float]:
    """The range as two numbers.  Raises InvalidProblem (shapes.diameter) for anything else."""
    small, large = readonly(diameter, (2,), "shapes.diameter").tolist()
    require(0 < small <= large, "shapes.diameter", "0 < least <= greatest", diameter)
    return small, large


@dataclass(frozen=True, kw_only=True)
class Shapes:
    """A distribution of simple polygons, most of them convex.

    facets: least and greatest number.  diameter: range [m].  shortest_facet: share of the mean facet length, and
    least length [m].  sharpest_corner, deepest_dent: least interior angle and greatest excess over pi [rad].
    slightest_turn: neighbouring facets differ by at least this angle [rad], so that each can be seen.
    """

    facets: tuple[int, int] = (4, 6)
    diameter: tuple[float, float] = (0.05, 0.10)
    shortest_facet: float = 0.4
    least_length: float = 0.006
    sharpest_corner: float = 0.7
    deepest_dent: float = 0.35
    slightest_turn: float = 0.1

    def __post_init__(self) -> None:
        few, many = readonly(self.facets, (2,), "shapes.facets").tolist()
        whole = few.is_integer() and many.is_integer()
        require(
            whole and 3 <= few <= many <= 64,
            "shapes.facets",
            "whole numbers 3 <= least <= greatest <= 64",
            list(self.facets),
        )
        object.__setattr__(self, "facets", (int(few), int(many)))
        object.__setattr__(self, "diameter", check_diameter(self.diameter))
        small, _ = self.diameter
        require(
            0 <= self.shortest_facet < 1, "shapes.shortest_facet", "a share in [0, 1)", self.shortest_facet
        )
        require(
            0 <= self.least_length < small, "shapes.least_length", "less than the diameter", self.least_length
        )
        for name in ("sharpest_corner", "deepest_dent", "slightest_turn"):
            angle = getattr(self, name)
            require(0 <= angle < np.pi, f"shapes.{name}", "an angle in [0, pi)", angle)

    def sample(self, rng: np.random.Generator) -> Array:
        """See sample_polygon."""
        return sample_polygon(rng, self)


def sample_polygon(rng: np.random.Generator, shapes: Shapes) -> Array:
    """Counter-clockwise vertices (V, 2) [m] about the centroid.  Raises InvalidProblem where `shapes` leaves nothing."""
    count = int(rng.integers(shapes.facets[0], shapes.facets[1] + 1))
    for _ in range(ATTEMPTS):
        vertices = _star(rng, count)
        vertices *= rng.uniform(*shapes.diameter) / diameter(vertices)
        if _acceptable(vertices, shapes):
            return vertices - mass_properties(vertices).centroid
    raise InvalidProblem(
        "shapes",
        expected=f"limits that polygons of {count} facets can meet",
        got=f"none in {ATTEMPTS} draws",
        remedy="lower shortest_facet, least_length or slightest_turn",
    )


def _star(rng: np.random.Generator, count: int) -> Array:
    """Star-shaped polygon: jittered directions and radii, stretched along a random axis."""
    directions = 2 * np.pi * (np.arange(count) + rng.uniform(-0.35, 0.35, count)) / count
    # A regular polygon turns reflex when a radius shrinks by more than this: the jitter keeps most shapes convex.
    sagitta = 1 - np.cos(2 * np.pi / count)
    radii = 1 - rng.uniform(0, 0.9, count) * min(sagitta, 0.8)
    points = radii[:, None] * np.column_stack([np.cos(directions), np.sin(directions)])
    stretch = np.array([1.0, rng.uniform(0.6, 1.0)])
    axis, turn = rng.uniform(0, 2 * np.pi, 2)
    return points @ rotation(axis) * stretch @ rotation(turn)


def _acceptable(vertices: Array, shapes: Shapes) -> bool:
    turns, lengths = exterior_angles(vertices), facet_lengths(vertices)
    return bool(
        signed_area(vertices) > 0
        and turns.max() <= np.pi - shapes.sharpest_corner
        and turns.min() >= -shapes.deepest_dent
        and np.abs(turns).min() >= shapes.slightest_turn
        and lengths.min() >= max(shapes.shortest_facet * lengths.mean(), shapes.least_length)
        and crossing_edges(vertices) is None
    )


def facet_lengths(vertices: Array) -> Array:
    """Lengths (V,) [m]."""
    a, b = facets(vertices)
    return np.linalg.norm(b - a, axis=1)


def exterior_angles(vertices: Array) -> Array:
    """Turns (V,) [rad] from the facet that ends in each vertex to the one that starts there; negative where reflex."""
    a, b = facets(vertices)
    after = b - a
    before = np.roll(after, 1, axis=0)
    return np.arctan2(cross(before, after), (before * after).sum(axis=1))


def stable_angles(vertices: Array, centre: Array) -> Array:
    """Orientations [rad] in which the polygon rests on one side of its hull, the weight at `centre` well inside it."""
    hull = np.array(shapely.MultiPoint(vertices).convex_hull.exterior.coords)[:-1]
    hull = hull if signed_area(hull) > 0 else hull[::-1]
    a, b = facets(hull)
    side = b - a
    share = ((centre - a) * side).sum(axis=1) / (side * side).sum(axis=1)
    stable = np.abs(share - 0.5) <= 0.5 - STABLE_SHARE
    return -np.arctan2(side[stable, 1], side[stable, 0])
