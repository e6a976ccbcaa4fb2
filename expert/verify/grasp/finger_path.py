"""Moving fingers and a polygon in relative lengths: the object's enclosing circle has radius 1, the goal is the origin.

Configurations are (x, y, theta) relative to the goal; s in [0, K - 1] is the path parameter: knot k is at s = k.
"""

import itertools
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from expert.geometry.polygon import facet_frames, reflex_vertices, signed_distance
from expert.geometry.pose import Array, rotation, wrapped
from expert.problems.cage import Arrangement
from expert.world.frame import Frame
from expert.world.shape import Shape


@dataclass(frozen=True)
class FingerPath:
    """Fingers along straight lines between knots (K, N, 2) around a shape with its goal pose; world frame [m]."""

    shape: Shape
    pose: Array
    knots_w: Array

    @cached_property
    def frame(self) -> Frame:
        """Relative lengths."""
        return Frame.of(self.shape, self.pose)

    @cached_property
    def knots(self) -> Array:
        """Relative finger positions (K, N, 2)."""
        return self.frame.relative(self.knots_w)

    @cached_property
    def vertices(self) -> Array:
        """Relative corners (V, 2) of the object at the goal."""
        return self.frame.body(self.shape.vertices)

    @cached_property
    def facets(self) -> "Facets":
        """Half-plane of each facet."""
        return Facets.of(self.vertices)

    @property
    def last(self) -> float:
        """Path parameter of the last knot."""
        return float(len(self.knots) - 1)

    def segment(self, s: float) -> tuple[int, float]:
        """Segment and fraction of it; a knot belongs to the segment that begins there, the last one to the last."""
        k = min(int(s), len(self.knots) - 2)
        return k, s - k

    def fingers(self, s: float) -> Array:
        """Relative positions (N, 2)."""
        k, t = self.segment(s)
        return (1 - t) * self.knots[k] + t * self.knots[k + 1]

    def arrangement(self, s: float) -> Arrangement:
        """The object at its goal among the fingers."""
        k, t = self.segment(s)
        return Arrangement(
            shape=self.shape, pose=self.pose, fingers=(1 - t) * self.knots_w[k] + t * self.knots_w[k + 1]
        )

    def configurations(self, poses: Array) -> Array:
        """Relative configurations (M, 3), within half a turn of the goal, of world poses (M, 3)."""
        q = self.frame.configuration(np.reshape(poses, (-1, 3)))
        return np.column_stack([q[:, :2], wrapped(q[:, 2])])

    def gap(self, configurations: Array, s: float) -> Array:
        """Distance (M,) of the nearest finger from the object at configurations (M, 3); negative: inside."""
        return self._gaps(configurations, self.fingers(s)).min(axis=1)

    def _gaps(self, configurations: Array, fingers: Array) -> Array:
        seen = (fingers[None] - configurations[:, None, :2]) @ rotation(configurations[:, 2])
        return signed_distance(self.vertices, seen)

    def deepest(self, configurations: Array, low: float, high: float) -> Array:
        """How far (M,) fingers come into resting objects (M, 3) while s goes from low to high; exact.

        Seen from a resting object fingers run along straight lines; between crossings of facets the distance to the
        boundary is largest, inside, at a break of the medial axis, so the depth is judged at the middle of each chord.
        """
        depth = np.zeros(len(configurations))
        stops = [low, *range(int(np.floor(low)) + 1, int(np.ceil(high))), high]
        for a, b in itertools.pairwise(stops):
            k = self.segment(0.5 * (a + b))[0]
            ends = [(1 - s + k) * self.knots[k] + (s - k) * self.knots[k + 1] for s in (a, b)]
            turn = rotation(configurations[:, 2])
            p, q = ((end[None] - configurations[:, None, :2]) @ turn for end in ends)
            depth = np.maximum(depth, _chord_depth(self.vertices, p, q))
        return depth


def _chord_depth(vertices: Array, p: Array, q: Array) -> Array:
    """Depth (M,) inside a polygon at the middles of the pieces into which its edges cut the lines p-q (M, N, 2)."""
    a, e = vertices, np.roll(vertices, -1, axis=0) - vertices
    step = q - p
    across = step[..., None, 0] * e[:, 1] - step[..., None, 1] * e[:, 0]
    gap = a - p[..., None, :]
    safe = np.where(across == 0, 1.0, across)
    t = (gap[..., 0] * e[:, 1] - gap[..., 1] * e[:, 0]) / safe
    t = np.clip(np.where(across == 0, 0.0, t), 0.0, 1.0)
    ends = np.zeros((*t.shape[:-1], 1))
    cuts = np.sort(np.concatenate([ends, t, ends + 1], axis=-1), axis=-1)
    middles = 0.5 * (cuts[..., 1:] + cuts[..., :-1])
    points = np.concatenate(
        [p[..., None, :] + middles[..., None] * step[..., None, :], p[..., None, :], q[..., None, :]], -2
    )
    return -np.minimum(signed_distance(vertices, points), 0.0).min(axis=(1, 2))


class Facets(NamedTuple):
    """Outside facet j is {y : normal_j . y >= offset_j}; facets run from start by length along tangent.

    reflex (V,): whether the corner at the start of facet j is reflex, so that one finger can touch facets j - 1 and j.
    A tuple, which compiled loops take as it is.
    """

    normals: Array
    offsets: Array
    starts: Array
    tangents: Array
    lengths: Array
    reflex: np.ndarray

    @classmethod
    def of(cls, vertices: Array) -> "Facets":
        """Of a counter-clockwise polygon."""
        inward, tangents = facet_frames(vertices)
        normals = -inward
        lengths = np.linalg.norm(np.roll(vertices, -1, axis=0) - vertices, axis=1)
        offsets = (normals * vertices).sum(axis=1)
        return cls(normals, offsets, vertices, tangents, lengths, reflex_vertices(vertices))
