"""Cages around form closures: fingers close to contacts that, with walls and fixed fingers, leave the object no motion.

Each placement of a finger, or of a gripper with its two, blocks some twists of the object: its contacts push back on them.
Placements are combined so that every twist is blocked, the firmest combination first.  A wall counts where it is near.

These are candidates only: every one must be verified.
"""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from expert.caging.requirements import TRIPOD
from expert.geometry.polygon import facet_frames, facets, reflex_vertices, signed_distance
from expert.geometry.pose import Array, cross, rotation, to_body
from expert.problems.cage import CageProblem
from expert.world.fingers import Gripper

CLEARANCES = (0.03, 0.015, 0.008, 0.005)
"""Of fingers from the object, relative to its size, in this order."""
NEAR = 0.1
"""Walls and fixed fingers within this distance, relative to the object's size, count as contacts."""
FAR = 0.25
"""The same for fingers of one-parameter grippers."""
FIRM = 0.03
"""Every unit twist (torques relative to half the object's size) must be opposed by at least this much."""
TWISTS, LEVELS, MOST, BEST = 200, 24, 60_000, 12
"""Twists looked at; lines across the object per gripper direction; combinations rated, and tried per clearance."""


@dataclass(frozen=True)
class Placements:
    """fingers (m, k, 2) [m, body frame]: m ways to place k fingers.  push (m, D): how firmly each opposes each twist."""

    fingers: Array
    push: Array


class Closures:
    """Form closures of one problem, in the body frame of its object."""

    def __init__(self, problem: CageProblem) -> None:
        self.problem = problem
        self.vertices, self.size = problem.shape.vertices, problem.shape.size
        self.centre = (self.vertices.min(axis=0) + self.vertices.max(axis=0)) / 2
        self.inward, _ = facet_frames(self.vertices)
        self.twists = _sphere(TWISTS)
        ends = problem.wall_ends
        self.walls = to_body(problem.pose, ends.reshape(-1, 2)).reshape(ends.shape)
        self.given = self._given()

    def candidates(self, rng: np.random.Generator) -> Iterator[Array]:
        """Fingers (count, 2) [m, body frame], the loosest first and among those the firmest."""
        for clearance in CLEARANCES:
            rated = []
            for direction in directions(self.problem):
                rated += self._closures(clearance * self.size, direction - self.problem.pose[2], rng)
            rated.sort(key=lambda pair: -pair[0])
            yield from (fingers for _, fingers in rated[:BEST])

    def _closures(
        self, clearance: float, direction: float, rng: np.random.Generator
    ) -> list[tuple[float, Array]]:
        """(firmness, fingers) of the best combinations of placements."""
        problem = self.problem
        if problem.cost == "max_opening" and problem.count == 3:
            return self._tripods(clearance)
        sites = self._sites(clearance)
        held = [k for gripper in problem.grippers for k in gripper.fingers]
        alone = [k for k in range(problem.count) if k not in held]
        if problem.count == 0 or len(set(held)) < len(held):
            return []  # nothing to place, or fingers shared by grippers
        units = [self._held(gripper, sites, direction, clearance) for gripper in problem.grippers]
        units += [self._placed(sites[:, None], clearance)] * len(alone)
        if any(not len(unit.fingers) for unit in units):
            return []
        choices = _combinations([len(unit.fingers) for unit in units], len(alone), rng)
        push = np.broadcast_to(self.given, (len(choices), TWISTS))
        for column, unit in zip(choices.T, units, strict=True):
            push = np.maximum(push, unit.push[column])
        firmness = push.min(axis=1)
        best = np.argsort(-firmness, kind="stable")[:BEST]
        order = np.argsort([*held, *alone])
        return [
            (
                float(firmness[c]),
                np.concatenate([u.fingers[k] for u, k in zip(units, choices[c], strict=True)])[order],
            )
            for c in best
            if firmness[c] > FIRM
        ]

    def _sites(self, clearance: float) -> Array:
        """Points (m, 2) at this distance from the object: along its facets and in its reflex corners."""
        a, b = facets(self.vertices)
        along = np.array([0.1, 0.3, 0.5, 0.7, 0.9])
        on = (a[:, None] + along[:, None] * (b - a)[:, None] - clearance * self.inward[:, None]).reshape(
            -1, 2
        )
        reflex = np.flatnonzero(reflex_vertices(self.vertices))
        n, before = -self.inward[reflex], -self.inward[reflex - 1]
        mitre = (n + before) / (1 + (n * before).sum(axis=1, keepdims=True))
        return self._reachable(np.concatenate([self.vertices[reflex] + clearance * mitre, on]), clearance)

    def _held(self, gripper: Gripper, sites: Array, direction: float, clearance: float) -> Placements:
        """Where a gripper may hold its two fingers: anywhere, or on lines of one direction."""
        groups = self._lines(direction, clearance) if self.problem.parallel else [sites]
        axis = np.array([np.cos(direction), np.sin(direction)])
        pairs = [np.empty((0, 2, 2))]
        for points in groups:
            i, j = np.nonzero(~np.eye(len(points), dtype=bool))
            step = points[j] - points[i]
            length = np.linalg.norm(step, axis=1)
            least, most = gripper.opening
            fits = (length >= least) & (length <= most) & (step @ axis > 0 if self.problem.parallel else True)
            pairs.append(np.stack([points[i[fits]], points[j[fits]]], axis=1))
        return self._placed(np.concatenate(pairs), clearance)

    def _tripods(self, clearance: float) -> list[tuple[float, Array]]:
        """(firmness, fingers) of one-parameter grippers whose fingers each stay clear of one facet, as three equations say.

        What each finger opposes is judged from afar: three contacts do not hold an object, but a reflex corner counts twice.
        """
        outward = -self.inward
        offsets = (outward * self.vertices).sum(axis=1) + clearance
        u = TRIPOD @ rotation(-self.problem.pose[2]).T
        triples = np.array(list(itertools.product(range(len(offsets)), repeat=3)))
        n = outward[triples]
        equations = np.concatenate([n, (n * u).sum(axis=2, keepdims=True)], axis=2)
        regular = np.abs(np.linalg.det(equations)) > 1e-6
        solved = np.linalg.solve(equations[regular], offsets[triples[regular]][..., None])[..., 0]
        fingers = solved[:, None, :2] + solved[:, 2, None, None] * u
        clear = (signed_distance(self.vertices, fingers) > 0.5 * clearance).all(axis=1) & (solved[:, 2] > 0)
        near = np.linalg.norm(fingers - self.centre, axis=2).max(axis=1) < 2 * self.size
        fingers = fingers[clear & near]
        push = self._push(fingers.reshape(-1, 2), FAR * self.size).reshape(-1, 3, TWISTS).max(axis=1)
        firmness = np.maximum(push, self.given).min(axis=1)
        return [(float(f), x) for f, x in zip(firmness, fingers, strict=True) if f > FIRM]

    def _lines(self, direction: float, clearance: float) -> list[Array]:
        """Points near the object on lines across it: off each facet that a line meets, and along those it runs beside."""
        turn = rotation(-direction)
        v = self.vertices @ turn.T
        a, b = facets(v)
        normal = -self.inward @ turn.T
        low, high = v[:, 1].min(), v[:, 1].max()
        beside = np.abs(normal[:, 0]) < 0.3
        levels = np.concatenate(
            [np.linspace(low, high, LEVELS + 2)[1:-1], v[:, 1] + clearance, v[:, 1] - clearance]
        )
        groups = []
        for y in np.unique(np.round(levels, 9)):
            crossed = ((a[:, 1] - y) * (b[:, 1] - y) < 0) & ~beside
            s = (y - a[crossed, 1]) / (b - a)[crossed, 1]
            x = a[crossed, 0] + s * (b - a)[crossed, 0] + clearance / normal[crossed, 0]
            runs = beside & (np.abs(((a + b) / 2)[:, 1] + clearance * normal[:, 1] - y) < 0.1 * clearance)
            x = np.concatenate([x, *(np.linspace(a[k, 0], b[k, 0], 7)[1:-1] for k in np.flatnonzero(runs))])
            points = np.column_stack([x, np.full(len(x), y)]) @ turn
            groups.append(self._reachable(points, 0.5 * clearance))
        return groups

    def _reachable(self, points: Array, clearance: float) -> Array:
        """Those clear of the object and on its side of every wall."""
        points = points[signed_distance(self.vertices, points) > 0.5 * clearance]
        outline = shapely.Polygon(self.vertices).exterior
        ways = shapely.shortest_line(shapely.points(points), outline)
        blocked = np.zeros(len(points), dtype=bool)
        for wall in self.walls:
            blocked |= shapely.intersects(ways, shapely.LineString(wall))
        return points[~blocked]

    def _placed(self, fingers: Array, clearance: float) -> Placements:
        push = self._push(fingers.reshape(-1, 2), 1.5 * clearance)
        return Placements(fingers, push.reshape(len(fingers), fingers.shape[1], TWISTS).max(axis=1))

    def _push(self, points: Array, reach: float) -> Array:
        """How firmly points (m, 2) oppose each twist (m, D): by the normals of facets that they face within reach."""
        a, b = facets(self.vertices)
        edge = b - a
        s = ((points[:, None] - a) * edge).sum(axis=2) / (edge**2).sum(axis=1)
        gap = np.abs(((points[:, None] - a) * self.inward).sum(axis=2))
        faced = (gap <= reach) & (s > -1e-9) & (s < 1 + 1e-9)
        wrenches = self._wrenches(a + s[..., None] * edge, np.broadcast_to(self.inward, (*s.shape, 2)))
        return np.where(faced[..., None], wrenches @ self.twists.T, -1.0).max(axis=1)

    def _given(self) -> Array:
        """What fixed fingers and walls oppose (D,): a wall meets the corners of the object that are near it."""
        push = np.full(TWISTS, -1.0)
        fixed = to_body(self.problem.pose, self.problem.fixed)
        if len(fixed):
            push = np.maximum(push, self._push(fixed, NEAR * self.size).max(axis=0))
        for a, b in self.walls:
            along = (b - a) / np.linalg.norm(b - a)
            s = (self.vertices - a) @ along
            height = cross(along, self.vertices - a)
            meets = (np.abs(height) < NEAR * self.size) & (s > 0) & (s < np.linalg.norm(b - a))
            normal = np.sign(np.median(height)) * np.array([-along[1], along[0]])
            at = self.vertices[meets]
            if len(at):
                wrenches = self._wrenches(at, np.broadcast_to(normal, at.shape))
                push = np.maximum(push, (wrenches @ self.twists.T).max(axis=0))
        return push

    def _wrenches(self, at: Array, force: Array) -> Array:
        torque = cross(at - self.centre, force) / (self.size / 2)
        return np.concatenate([force, torque[..., None]], axis=-1)


def directions(problem: CageProblem) -> list[float]:
    """World directions [rad] in which parallel grippers are tried: x, y, then along and across the object's facets.

    One, without meaning, where there are no such grippers.
    """
    if not problem.parallel or not problem.grippers:
        return [0.0]
    if problem.direction is not None:
        return [problem.direction]
    a, b = facets(problem.shape.vertices)
    along = np.arctan2(*(b - a).T[::-1]) + problem.pose[2]
    found: list[float] = []
    for angle in (0.0, np.pi / 2, *along, *(along + np.pi / 2)):
        if all(abs(np.sin(angle - other)) > np.sin(np.radians(3)) for other in found):
            found.append(float(np.arctan(np.tan(angle))) if abs(np.cos(angle)) > 1e-9 else np.pi / 2)
    return found


def _combinations(sizes: Sequence[int], alike: int, rng: np.random.Generator) -> Array:
    """Index tuples (c, units), all or at most MOST of them at random; the last `alike` units are interchangeable."""
    if np.prod([float(n) for n in sizes]) <= MOST:
        choices = np.array(list(itertools.product(*map(range, sizes))))
    else:
        choices = np.column_stack([rng.integers(0, n, MOST) for n in sizes])
    last = choices[:, len(sizes) - alike :]
    return choices[(np.diff(last, axis=1) > 0).all(axis=1)]


def _sphere(count: int) -> Array:
    """Unit vectors (count, 3), evenly spread along a spiral."""
    k = np.arange(count) + 0.5
    z = 1 - 2 * k / count
    angle = np.pi * (1 + np.sqrt(5)) * k
    r = np.sqrt(1 - z**2)
    return np.column_stack([r * np.cos(angle), r * np.sin(angle), z])
