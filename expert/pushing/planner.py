"""Which push next: search over the table, the last push made exact, the finger's way checked; fewest control steps win."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from expert.geometry.pose import Array, rotation, to_world
from expert.pushing.approach import LONGEST, Travel
from expert.pushing.goal import Goal
from expert.pushing.impulse_model import ImpulseModel
from expert.pushing.outline import clearance
from expert.pushing.refine import composed, refine
from expert.pushing.room import EVERYWHERE, NOTHING, Room, inside
from expert.pushing.search import Moves, Nodes, Prices, Task, beam_search, moves_of, poses_of
from expert.pushing.table import Table, steadiness, straight

TOUCHING = 0.85
"""A finger whose centre is nearer than this fraction of its radius is inside the object, not beside it."""


PRICES = Prices(miss=15.0, error=0.3, travel=2.0, pace=150.0, capture=10.0)


@dataclass(frozen=True, kw_only=True)
class Effort:
    """Size of the search: depth in pushes, width of the beam, plans whose last push is refined, and rounds of that."""

    depth: int = 3
    width: int = 24
    endings: int = 24
    rounds: int = 4
    ranked: int = 6
    clearance: float = 2.0


@dataclass(frozen=True, kw_only=True)
class Workspace:
    """Half-planes (n, 3) = (normal, normal . point): where the object may be, and where the finger's centre may."""

    walls: Array = field(default_factory=lambda: np.zeros((0, 3)))
    finger_walls: Array = field(default_factory=lambda: np.zeros((0, 3)))


def box(lower: float, upper: float) -> Array:
    """Half-planes (4, 3) of a square from (lower, lower) to (upper, upper)."""
    return np.array([[1, 0, lower], [0, 1, lower], [-1, 0, -upper], [0, -1, -upper]], dtype=float)


@dataclass(frozen=True)
class Plan:
    """The next push: commands (n, 2) up to its end, of which the first `travel` only move the finger.

    expected (3,): pose after it; pushes, steps, error: of the whole plan; reaches: whether the plan ends within tolerance.
    parameters (3,): the push, as tables have it.
    """

    commands: Array
    travel: int
    expected: Array
    pushes: int
    steps: float
    error: float
    reaches: bool
    parameters: Array


@dataclass(frozen=True)
class _Candidate:
    """A plan before its first way is checked: first push, and what follows."""

    first: Array
    pushes: int
    time: float
    error: float
    reaches: bool


@dataclass(frozen=True)
class Planner:
    """Plans pushes of one object to one goal."""

    table: Table
    model: ImpulseModel
    goal: Goal
    workspace: Workspace = field(default_factory=Workspace)
    prices: Prices = PRICES
    effort: Effort = field(default_factory=Effort)

    @cached_property
    def moves(self) -> Moves:
        """The table for compiled code."""
        return moves_of(self.table, self.goal.centroid)

    @cached_property
    def task(self) -> Task:
        """The goal and the walls for compiled code."""
        model, goal, space = self.model, self.goal, self.workspace
        hull = model.shape.vertices - model.origin
        room = Room(hull, space.walls, space.finger_walls, model.edges, NOTHING, 0.0, 0.0, EVERYWHERE)
        return Task(goal.poses, goal.centroid, goal.spread, room)

    @cached_property
    def travel(self) -> Travel:
        """The finger's ways."""
        model = self.model
        return Travel(
            model.drive, model.edges, self.table.ways, self.effort.clearance, self.workspace.finger_walls
        )

    def rehearse(self) -> None:
        """Load compiled code and work out what plans have in common, so that the first plan takes no longer than others."""
        self.travel.prepare()
        pose, still = self.goal.pose, np.zeros(2)
        beside, within = to_world(pose, np.stack([self.table.ways.stations[0], self.goal.centroid]))
        for position in (beside, within):
            self.plan(pose, position, still, tolerance=1.0)

    def plan(
        self, pose: Array, position: Array, velocity: Array, tolerance: float, weight: float = 1.0
    ) -> Plan | None:
        """The next push from a pose (3,) of the object and the finger's state; None: no push has a clear way.

        A finger inside the object, or wedged so that no way leads off, first goes straight out: a plan without a push.
        tolerance: error at which the object has arrived; weight: of the estimate of the rest.
        """
        prices = self.prices._replace(miss=weight * self.prices.miss, error=weight * self.prices.error)
        finger = rotation(pose[2]).T @ (position - pose[:2])
        if clearance(self.model.edges, *finger) < TOUCHING * self.model.radius:
            return self._escape(pose, position, velocity)
        for depth, width in ((self.effort.depth, self.effort.width), (1, len(self.table.stations))):
            nodes, ends = beam_search(
                self.moves, self.task, prices, pose, finger, depth, width, self.effort.endings
            )
            candidates = [
                *self._endings(nodes, ends, pose, tolerance),
                *self._unfinished(nodes[-width:], nodes),
            ]
            if plan := self._checked(candidates, pose, position, velocity, prices):
                return plan
        return self._escape(pose, position, velocity)

    def _escape(self, pose: Array, position: Array, velocity: Array) -> Plan | None:
        """Straight off the object, for a finger in it or at it."""
        out = self.travel.retreat(pose, position, self.table.grid.gap)
        if out is None:
            return None
        commands = self.model.drive.commands(3, position, velocity, out, {})
        return Plan(commands, 3, pose, 0, np.inf, float(self.goal.error(pose)), False, np.zeros(3))

    def _endings(self, nodes: Nodes, ends: Nodes, pose: Array, tolerance: float) -> list[_Candidate]:
        """Plans that reach the goal, with their last push refined; soonest first."""
        ends = ends[np.isfinite(ends["score"])]
        if not len(ends):
            return []
        before = np.where(ends["parent"][:, None] < 0, pose, poses_of(nodes)[ends["parent"]])
        table, grid = self.table, self.table.grid
        parameters, _, _, errors = refine(
            table, self.goal, before, table.parameters[ends["entry"]], self.effort.rounds
        )
        shifts, _ = table.outcomes(parameters)
        unsteady = steadiness(self.model, table.curve, parameters, shifts, grid.wobble)
        errors = np.where(unsteady <= grid.spread * grid.wobble, errors, np.inf)
        steps = self.model.steps(parameters[:, 2]) - self.table.steps[ends["entry"]]
        found = []
        for k in np.argsort(ends["time"] + steps + errors / tolerance):
            if errors[k] > tolerance:
                continue
            chain = self._chain(nodes, int(ends["parent"][k]))
            first = self.table.parameters[nodes["entry"][chain[0]]] if chain else parameters[k]
            time = float(ends["time"][k] + steps[k])
            found.append(_Candidate(first, len(chain) + 1, time, float(errors[k]), True))
        return found

    def _unfinished(self, last: Nodes, nodes: Nodes) -> list[_Candidate]:
        """Plans of full depth: `last` is the last level of the nodes."""
        found = []
        for node in last[np.isfinite(last["score"])]:
            chain = [*self._chain(nodes, int(node["parent"])), node["entry"]]
            entry = nodes["entry"][chain[0]] if len(chain) > 1 else node["entry"]
            first, error = self.table.parameters[entry], float(node["error"])
            found.append(_Candidate(first, len(chain), float(node["score"]), error, False))
        return found

    def _chain(self, nodes: Nodes, row: int) -> list[int]:
        """Rows from the first push to `row`."""
        chain: list[int] = []
        while row >= 0:
            chain.insert(0, row)
            row = int(nodes["parent"][row])
        return chain

    def _checked(
        self, candidates: list[_Candidate], pose: Array, position: Array, velocity: Array, prices: Prices
    ) -> Plan | None:
        """The soonest of the first few candidates whose way is clear, counting the steps of that way."""
        best: Plan | None = None
        seen: set[bytes] = set()
        for candidate in candidates:
            if len(seen) >= self.effort.ranked and best is not None:
                break
            if (key := candidate.first.tobytes()) in seen:
                continue
            seen.add(key)
            if plan := self._with_way(candidate, pose, position, velocity, prices, best):
                best = plan
        return best

    def _with_way(
        self,
        candidate: _Candidate,
        pose: Array,
        position: Array,
        velocity: Array,
        prices: Prices,
        best: Plan | None,
    ) -> Plan | None:
        """The candidate's plan; None: no clear way that makes it better than the best one so far."""
        starts, directions, lengths = straight(self.table.curve, candidate.first[None])
        start = to_world(pose, starts)[0]
        before_way = candidate.time - prices.travel - float(np.linalg.norm(start - position)) / prices.pace
        longest = LONGEST
        if best is not None and candidate.reaches <= best.reaches:
            allowed = best.steps - before_way if candidate.reaches == best.reaches else 0.0
            longest = min(LONGEST, int(np.ceil(allowed)) - 1)
        way = self.travel.commands(pose, start, position, velocity, longest)
        if way is None:
            return None
        steps = int(self.model.steps(lengths)[0])
        push = start + self.model.weights(steps)[:, None] * (lengths[0] * rotation(pose[2]) @ directions[0])
        if not all(inside(self.workspace.finger_walls, x, y, 1e-9) for x, y in push):
            return None
        expected = composed(pose[None], self.table.outcomes(candidate.first[None])[0])[0]
        return Plan(
            np.concatenate([way, push]),
            len(way),
            expected,
            candidate.pushes,
            before_way + len(way),
            candidate.error,
            candidate.reaches,
            candidate.first,
        )
