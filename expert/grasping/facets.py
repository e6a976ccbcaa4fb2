"""Facets of the object as fingers see them, and the tuples of facets that can hold it.  Relative lengths."""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely

from expert.geometry.convex import Region
from expert.geometry.polygon import facet_frames, facets
from expert.geometry.pose import Array
from expert.loops.normals import same_direction, spans

MOST_FACETS = 20
"""Of an object with more facets some are no place for a finger: what is left has about 9,000 choices of four."""


@dataclass(frozen=True)
class Facets:
    """Outward normals n and tangents (V, 2), offsets d (n . y = d), ends low, high along the tangent, each (V,)."""

    vertices: Array
    normals: Array
    tangents: Array
    offsets: Array
    low: Array
    high: Array

    @classmethod
    def of(cls, vertices: Array) -> "Facets":
        """Facets of a counter-clockwise polygon."""
        inward, tangents = facet_frames(vertices)
        a, b = facets(vertices)
        return cls(
            vertices,
            -inward,
            tangents,
            -(inward * a).sum(axis=1),
            (tangents * a).sum(axis=1),
            (tangents * b).sum(axis=1),
        )

    def __len__(self) -> int:
        return len(self.offsets)

    def wedge(self, k: int) -> Region | None:
        """Convex free region over a facet; None where all beyond its line is free."""
        if k not in self._wedges:
            self._wedges[k] = _wedge(self, k)
        return self._wedges[k]

    @cached_property
    def _wedges(self) -> dict[int, Region | None]:
        """Those that were asked for: on objects of many facets each takes a while."""
        return {}

    @cached_property
    def sides(self) -> np.ndarray:
        """What lies beyond the line of each facet, as polygons (V,) that reach far over the object."""
        size = 4 * float(np.abs(self.vertices).max())
        foot, n, t = self.offsets[:, None] * self.normals, self.normals, self.tangents
        corners = np.stack(
            [foot - size * t, foot + size * t, foot + size * (t + n), foot - size * (t - n)], axis=1
        )
        return shapely.polygons(corners)

    def beyond(self, k: int) -> Region:
        """The half-plane beyond facet k's line, less what its wedge excludes."""
        wedge = self.wedge(k)
        normals, offsets = -self.normals[[k]], -self.offsets[[k]]
        if wedge is None:
            return Region(normals, offsets)
        return Region(np.concatenate([normals, wedge.A]), np.concatenate([offsets, wedge.b]))

    def by_angle(self, chosen: tuple[int, ...]) -> tuple[int, ...]:
        """The same facets in the order of their normals' angles."""
        angle = np.arctan2(self.normals[:, 1], self.normals[:, 0])
        return tuple(sorted(chosen, key=lambda k: (angle[k], k)))

    def neighbours(self, chosen: tuple[int, ...]) -> list[tuple[int, int]]:
        """Pairs of positions in `chosen` (sorted by angle) whose facet lines bound the cell next to each other.

        Facets of one direction take turns in bounding it, so each of them neighbours all of the next direction.
        """
        groups: list[list[int]] = []
        for k, facet in enumerate(chosen):
            alike = groups and same_direction(self.normals[chosen[groups[-1][0]]], self.normals[facet])
            if alike:
                groups[-1].append(k)
            else:
                groups.append([k])
        if len(groups) > 1 and same_direction(
            self.normals[chosen[groups[0][0]]], self.normals[chosen[groups[-1][0]]]
        ):
            groups[0] = groups.pop() + groups[0]
        following = groups[1:] + groups[:1]
        return [pair for a, b in zip(groups, following, strict=True) for pair in itertools.product(a, b)]


def tuples(table: Facets, count: int) -> Iterator[tuple[int, ...]]:
    """Facets that `count` fingers can hold the object by, two fingers on a facet at most, sorted by normal angle.

    Of the longest MOST_FACETS only: the longer a facet, the farther the object may turn with a finger on it.
    """
    longest = np.argsort(table.low - table.high, kind="stable")[:MOST_FACETS]
    for chosen in itertools.combinations_with_replacement(np.sort(longest).tolist(), count):
        most = max(chosen.count(k) for k in chosen)
        if most <= 2 and spans(table.normals[list(chosen)]):
            yield table.by_angle(chosen)


def _wedge(table: Facets, k: int) -> Region | None:
    """Half-planes beyond facets, the fewest that keep the region over facet k free of the object."""
    polygon = shapely.Polygon(table.vertices)
    region, chosen = table.sides[k], list[int]()
    area = 1e-9 * polygon.area
    while region.intersection(polygon).area > area:
        smaller = shapely.intersection(region, table.sides)
        kept, overlap = _merit(smaller, polygon, table, k)
        kept[[k, *chosen]] = -1.0
        best = int(np.lexsort((overlap, -kept))[0])
        if smaller[best].area >= region.area - area:
            return Region(
                np.zeros((1, 2)), np.array([-1.0])
            )  # nothing separates: no finger may use this facet
        region = smaller[best]
        chosen.append(best)
    if not chosen:
        return None
    return Region(-table.normals[chosen], -table.offsets[chosen])


def _merit(regions: np.ndarray, polygon: shapely.Polygon, table: Facets, k: int) -> tuple[Array, Array]:
    """What share of facet k remains next to each region, to a hundredth, and how much of the object is inside."""
    a, b = (ends[k] for ends in facets(table.vertices))
    beside = shapely.intersection(shapely.buffer(regions, 1e-9), shapely.LineString([a, b]))
    share = shapely.length(beside) / float(np.linalg.norm(b - a))
    return np.round(np.minimum(share, 1.0), 2), shapely.area(shapely.intersection(regions, polygon))
