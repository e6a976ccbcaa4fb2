"""The finger's travel: commands to rest at a point, with a clear way round the object at every substep."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numba import njit

from expert.geometry.pose import Array, rotation, to_body, to_world
from expert.pushing.drive import Drive, gains, substep_map
from expert.pushing.outline import Outline, clearance, touch
from expert.pushing.roads import Roads, bends
from expert.pushing.room import inside

BULGES = (0.0, 0.5, 1.2)
"""Bends are tried at their corners, and farther out by these multiples of the radius."""
LONGEST = 9
"""Steps of a travel."""
MOST_POINTS = 4
"""On ways that are prepared for; longer ones take a moment."""
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

    def commands(
        self, pose: Array, end: Array, position: Array, velocity: Array, longest: int = LONGEST
    ) -> Array | None:
        """Fewest commands (n, 2), at most `longest`, to rest at `end` (2,), beside the object at a pose (3,).

        None: none found.  The finger keeps its gap to the object at rest, or, as long as it is nearer, moves away from it.
        """
        start, goal = to_body(pose, np.stack([position, end]))
        station = int(((self.ways.stations - goal) ** 2).sum(1).argmin())
        corners = [to_world(pose, corner[None])[0] for corner in bends(self.ways, start, station)]
        off = [] if (out := self.retreat(pose, position, 2 * self.gap)) is None else [out]
        through = list(_through(corners, off, pose[:2], self.drive.radius))
        need, slack = self.drive.radius + self.gap, SLACK * self.drive.radius
        gate = Gate(self.edges, pose, need, slack, self.walls, *substep_map(self.drive), self.drive.substeps)
        for steps in range(2, longest + 1):
            for points in through:
                if len(points) <= steps - 2:
                    known = np.stack([position, velocity, end, *points])
                    ways = _timings(self.drive, steps, len(points)) @ known
                    if (clear := _first_clear(gate, position, velocity, ways)) >= 0:
                        return np.asarray(ways[clear])
        return None

    def prepare(self) -> None:
        """Work out beforehand how the drive passes points, for ways with up to MOST_POINTS of them."""
        for points in range(MOST_POINTS + 1):
            for steps in range(2 + points, LONGEST + 1):
                _timings(self.drive, steps, points)

    def retreat(self, pose: Array, position: Array, gap: float) -> Array | None:
        """The point (2,) straight off the object with the given gap; None where the finger has it already."""
        p = to_body(pose, position[None])[0]
        near = min(
            (touch(self.edges, k, *p) for k in range(len(self.edges.first) - 1)), key=lambda t: t.distance
        )
        depth = self.drive.radius + gap - near.distance
        return None if depth <= 0 else position - depth * rotation(pose[2]) @ [near.nx, near.ny]


def _through(corners: list[Array], off: list[Array], centre: Array, radius: float) -> Iterator[list[Array]]:
    """Points that the finger shall pass, one after the other."""
    for bulge in BULGES if corners else BULGES[:1]:
        outer = [p + bulge * radius * (p - centre) / np.linalg.norm(p - centre) for p in corners]
        yield outer
        if off:
            yield off + outer


@lru_cache
def _timings(drive: Drive, steps: int, points: int) -> Array:
    """Gains (ways, steps, 3 + points) of all choices of the steps after which the points are passed."""
    return np.array([gains(drive, steps, at) for at in combinations(range(1, steps), points)])


class Gate(NamedTuple):
    """What a way is checked against: edges of the object at a pose (3,), distance that the finger's centre needs, walls.

    a (2, 2) and b (2,): the drive's substep.
    """

    edges: Outline
    pose: Array
    need: float
    slack: float
    walls: Array
    a: Array
    b: Array
    substeps: int


@njit(cache=True, error_model="numpy")
def _first_clear(gate: Gate, position: Array, velocity: Array, ways: Array) -> int:
    """Which of the ways (N, steps, 2) is the first that is clear; -1: none."""
    for k in range(len(ways)):
        if _clear(gate, position, velocity, ways[k]):
            return k
    return -1


@njit(cache=True, error_model="numpy")
def _clear(gate: Gate, position: Array, velocity: Array, commands: Array) -> bool:
    """Whether the finger keeps the distance that it needs once it has it, gives little of it up before, and keeps to the walls."""
    for k in range(len(commands)):
        if not inside(gate.walls, commands[k, 0], commands[k, 1], 1e-9):
            return False
    c, s = np.cos(gate.pose[2]), np.sin(gate.pose[2])
    p, v = position.copy(), velocity.copy()
    a, b = gate.a, gate.b
    reached = min(gate.need, clearance(gate.edges, *_body(p, gate.pose, c, s)))
    for k in range(len(commands)):
        for _ in range(gate.substeps):
            for d in range(2):
                p[d], v[d] = (
                    a[0, 0] * p[d] + a[0, 1] * v[d] + b[0] * commands[k, d],
                    a[1, 0] * p[d] + a[1, 1] * v[d] + b[1] * commands[k, d],
                )
            gap = clearance(gate.edges, *_body(p, gate.pose, c, s))
            if gap < (gate.need if reached >= gate.need else reached - gate.slack):
                return False
            reached = max(reached, min(gap, gate.need))
    return True


@njit(cache=True, error_model="numpy")
def _body(p: Array, pose: Array, c: float, s: float) -> tuple[float, float]:
    rx, ry = p[0] - pose[0], p[1] - pose[1]
    return c * rx + s * ry, c * ry - s * rx
