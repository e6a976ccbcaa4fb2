"""The finger's travel: commands to rest at a point, with a clear way round the object at every substep."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numba import njit

from expert.geometry.pose import Array, rotation, to_body, to_world
from expert.pushing.drive import Drive, substep_map
from expert.pushing.outline import Outline, clearance, touch
from expert.pushing.roads import Roads, bends
from expert.pushing.search import inside

BULGES = (0.0, 0.5, 1.2)
"""Bends are tried at their corners, and farther out by these multiples of the radius."""
LONGEST = 9
"""Steps of a travel."""
SLACK = 0.02
"""A finger that is nearer than its gap may come nearer yet by this fraction of its radius: places are known no better."""


@dataclass(frozen=True)
class Travel:
    """How a finger gets round an object: its drive, the object's edges, the ways, and the gap that it keeps.

    walls: half-planes (F, 3) to which the finger's centre and its commands keep; points are in the world.
    """

    drive: Drive
    edges: Outline
    ways: Roads
    gap: float
    walls: Array

    def commands(self, pose: Array, end: Array, position: Array, velocity: Array) -> Array | None:
        """Fewest commands (n, 2) to rest at `end` (2,), beside the object at a pose (3,); None: none found."""
        start, goal = to_body(pose, np.stack([position, end]))
        station = int(((self.ways.stations - goal) ** 2).sum(1).argmin())
        corners = [to_world(pose, corner[None])[0] for corner in bends(self.ways, start, station)]
        off = [] if (out := self.retreat(pose, position, 2 * self.gap)) is None else [out]
        for steps in range(2, LONGEST + 1):
            for via in _vias(steps, corners, off, pose[:2], self.drive.radius):
                commands = self.drive.commands(steps, position, velocity, end, via)
                if self.is_clear(pose, position, velocity, commands):
                    return commands
        return None

    def is_clear(self, pose: Array, position: Array, velocity: Array, commands: Array) -> bool:
        """Whether the finger keeps its gap to the object at rest, or, as long as it is nearer, moves away from it."""
        if not all(inside(self.walls, x, y, 1e-9) for x, y in commands):
            return False
        a, b = substep_map(self.drive)
        need = self.drive.radius + self.gap
        return bool(
            _clear(
                self.edges,
                pose,
                position,
                velocity,
                commands,
                a,
                b,
                self.drive.substeps,
                need,
                SLACK * self.drive.radius,
            )
        )

    def retreat(self, pose: Array, position: Array, gap: float) -> Array | None:
        """The point (2,) straight off the object with the given gap; None where the finger has it already."""
        p = to_body(pose, position[None])[0]
        near = min(
            (touch(self.edges, k, *p) for k in range(len(self.edges.first) - 1)), key=lambda t: t.distance
        )
        depth = self.drive.radius + gap - near.distance
        return None if depth <= 0 else position - depth * rotation(pose[2]) @ [near.nx, near.ny]


def _vias(
    steps: int, corners: list[Array], off: list[Array], centre: Array, radius: float
) -> Iterator[dict[int, Array]]:
    """Points that the finger shall pass, by the step after which it does."""
    for bulge in BULGES if corners else BULGES[:1]:
        outer = [p + bulge * radius * (p - centre) / np.linalg.norm(p - centre) for p in corners]
        for points in [outer, off + outer] if off else [outer]:
            if len(points) <= steps - 2:
                for at in combinations(range(1, steps), len(points)):
                    yield dict(zip(at, points, strict=True))


@njit(cache=True, error_model="numpy")
def _clear(
    edges: Outline,
    pose: Array,
    position: Array,
    velocity: Array,
    commands: Array,
    a: Array,
    b: Array,
    substeps: int,
    need: float,
    slack: float,
) -> bool:
    c, s = np.cos(pose[2]), np.sin(pose[2])
    p, v = position.copy(), velocity.copy()
    reached = min(need, clearance(edges, *_body(p, pose, c, s)))
    for k in range(len(commands)):
        for _ in range(substeps):
            for d in range(2):
                p[d], v[d] = (
                    a[0, 0] * p[d] + a[0, 1] * v[d] + b[0] * commands[k, d],
                    a[1, 0] * p[d] + a[1, 1] * v[d] + b[1] * commands[k, d],
                )
            gap = clearance(edges, *_body(p, pose, c, s))
            if gap < (need if reached >= need else reached - slack):
                return False
            reached = max(reached, min(gap, need))
    return True


@njit(cache=True, error_model="numpy")
def _body(p: Array, pose: Array, c: float, s: float) -> tuple[float, float]:
    rx, ry = p[0] - pose[0], p[1] - pose[1]
    return c * rx + s * ry, c * ry - s * rx
