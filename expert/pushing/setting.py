"""A problem of pushing made ready for the search: models, table, goal, room and prices."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from expert.geometry.pose import Array, moved_origin, to_body
from expert.problems.push import PushProblem
from expert.pushing.coulomb_model import CoulombModel
from expert.pushing.detours import lengths_to
from expert.pushing.goal import Goal
from expert.pushing.limit_surface import Surface, ellipsoid, uniform
from expert.pushing.outline import Outline, outline
from expert.pushing.room import EVERYWHERE, NOTHING, Field, Room, finger_fits, fits
from expert.pushing.search import Moves, Prices, Task, moves_of
from expert.pushing.table import Grid, Table, push_table
from expert.world.shape import Shape

STATIONS, ANGLES = 60, (-45, -30, -15, 0, 15, 30, 45)
SHORTEST, LONGEST, LENGTHS = 0.06, 1.6, 20
"""Of the pushes in the table, over the object's size; as many, each longer by the same factor."""
WOBBLE, SPREAD = 0.004, 2.0
"""How well the finger's place is kept, over the object's size: pushes whose ends then differ by more than this multiple are
left out.  Nobody looks between the pushes of a plan: deviations grow from one to the next."""
COARSE, FINE = 12, 30
"""Pressure points on a side: of the table, and of what is worked out in full."""
NODES = 80
"""Of the grid of ways round obstacles, along the longer side."""
CLOSER = 0.6
"""Plans shall end within this fraction of the tolerance."""


@dataclass(frozen=True)
class Pushing:
    """A problem made ready for the search; poses are those of the object's centroid."""

    problem: PushProblem

    @cached_property
    def model(self) -> CoulombModel:
        """The model of the table."""
        return self._model(COARSE)

    @cached_property
    def table(self) -> Table:
        """Pushes in the object's frame."""
        size = self.problem.shape.size
        lengths = size * np.geomspace(SHORTEST, LONGEST, LENGTHS)
        grid = Grid(
            stations=STATIONS,
            angles=tuple(np.deg2rad(ANGLES)),
            lengths=tuple(lengths.tolist()),
            gap=1.5 * self.problem.clearance,
            least=0.01 * size,
            wobble=WOBBLE * size,
            spread=SPREAD,
        )
        return push_table(self.model, grid)

    @cached_property
    def fine(self) -> Table:
        """The same pushes under a finer model."""
        return replace(self.table, model=self._finest)

    @cached_property
    def _finest(self) -> CoulombModel:
        return self._model(FINE)

    @cached_property
    def goal(self) -> Goal:
        """Of the centroid."""
        return Goal(self.problem.shape, self.model.origin, self._about(self.problem.goal), symmetric=False)

    @cached_property
    def tolerance(self) -> float:
        """Root-mean-square displacement within which both of the problem's tolerances hold."""
        allowed = self.problem.tolerance
        turn = 2 * np.sqrt(self.goal.spread) * np.sin(min(allowed.angle, np.pi) / 2)
        return CLOSER * min(allowed.position, float(turn))

    @cached_property
    def moves(self) -> Moves:
        """The table for compiled code."""
        return moves_of(self.table, self.goal.centroid)

    @cached_property
    def task(self) -> Task:
        """Goal and room for compiled code."""
        p = self.problem
        finger_walls = p.walls + [0.0, 0.0, p.radius]
        obstacles = _outlines(tuple(o.vertices for o in p.obstacles))
        field = EVERYWHERE
        if p.obstacles:
            lengths, low, cell = lengths_to(p, self.goal.pose[:2], NODES)
            field = Field(lengths, float(low[0]), float(low[1]), cell)
        hull = p.shape.vertices - self.model.origin
        kept = p.radius + p.clearance
        room = Room(hull, p.walls, finger_walls, self.model.edges, obstacles, p.clearance, kept, field)
        return Task(self.goal.poses, self.goal.centroid, self.goal.spread, room)

    @cached_property
    def prices(self) -> Prices:
        """In seconds."""
        finger, size = self.problem.finger, self.problem.shape.size
        unit = size / finger.push_speed
        return Prices(
            miss=unit,
            error=3 / finger.push_speed,
            travel=2 * self.problem.clearance / finger.travel_speed,
            pace=finger.travel_speed,
            capture=max(0.12 * size, self.tolerance),
        )

    def start(self) -> tuple[Array, Array]:
        """Pose (3,) of the centroid, and the finger (2,) in its frame."""
        pose = self._about(self.problem.start)
        return pose, to_body(pose, self.problem.finger.start[None])[0]

    def frame(self, pose: Array) -> Array:
        """Pose (3,) of the problem's frame, from that of the centroid."""
        return moved_origin(pose, -self.model.origin)

    def path(self, start: Array, direction: Array, length: float) -> Array:
        """Poses (n, 3) on the way of one push, in the frame before it, by the finer model; an entry each hundredth of the size."""
        count = 2 + int(length / (0.01 * self.problem.shape.size))
        return self._finest.path(start, direction, length, count)

    def is_free(self, poses: Array, finger: Array) -> bool:
        """Whether the object is, at poses (n, 3) of the centroid, and a finger (2,); not where there is no pose."""
        room = self.task.room
        known = bool(np.isfinite(poses).all()) and finger_fits(room, finger[0], finger[1])
        return known and all(fits(room, x, y, angle, 1e-9) for x, y, angle in poses)

    def _about(self, pose: Array) -> Array:
        return moved_origin(pose, self.model.origin)

    def _model(self, per_side: int) -> CoulombModel:
        p = self.problem
        surface: Surface = (
            uniform(p.shape, per_side) if p.limit_surface.c is None else ellipsoid(p.limit_surface.c)
        )
        finger = p.finger
        return CoulombModel(
            shape=p.shape,
            origin=p.centroid,
            surface=surface,
            radius=p.radius,
            friction=finger.friction,
            speed=finger.push_speed,
        )


def _outlines(polygons: tuple[Array, ...]) -> Outline:
    """Convex pieces of all polygons, in the world."""
    if not polygons:
        return NOTHING
    parts = [outline(Shape(vertices=v), np.zeros(2)) for v in polygons]
    starts, normals, tangents, lengths = (
        np.concatenate([getattr(part, name) for part in parts]) for name in Outline._fields[:4]
    )
    counts = np.concatenate([np.diff(part.first) for part in parts])
    return Outline(starts, normals, tangents, lengths, np.concatenate([[0], np.cumsum(counts)]))
