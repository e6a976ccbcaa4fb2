"""The exact solver's tree: best-first search over contact modes, contact positions and free regions.

A prefix of modes is bounded by its forces so far, each finger's least smoothing cost and the cost-to-go; a complete
mode sequence becomes a box of contact positions (see `tree`).
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from expert.budget import Budget
from expert.contact.modes import Moves, cost_to_go, last_costs, moves_of, step_costs, window_costs
from expert.contact.ranges import Pieces, narrow
from expert.contact.scaled import ScaledTask
from expert.contact.sequence import Sequence, sequence_of
from expert.contact.smoothing import least_smoothing
from expert.contact.tree import Node, Outcome, Tree
from expert.problems.contact import FREE
from expert.world.values import IntArray


@dataclass(frozen=True)
class Prefix:
    """Modes of the first steps, one tuple per finger; joint automaton state; cost of the forces before the last step."""

    modes: tuple[tuple[int, ...], ...]
    state: int
    forces: float
    settled: bool = False


class Planted(NamedTuple):
    """A complete mode sequence: what of its box was cut off, and the rest, None if nothing is left."""

    sequence: Sequence
    removed: Pieces
    rest: Node | None


class Search(Tree):
    """The tree of all mode sequences, grown from prefixes, and its tables for one task."""

    def __init__(self, scaled: ScaledTask, fingers: int, gap: float) -> None:
        super().__init__(scaled, fingers, gap)
        self.moves: Moves = moves_of(scaled.facets, fingers, scaled.min_interval)
        self.phi = step_costs(scaled, fingers)
        self.windows = window_costs(scaled)
        last = last_costs(scaled, self.phi.cost, self.moves)
        self.to_go = cost_to_go(self.phi.cost, self.windows, self.moves, last)
        self.smoothing: dict[tuple[int, ...], float] = {}
        self.planted: list[Planted] = []

    def run(self, budget: Budget, node_limit: int | None = None) -> Outcome:
        """Search until the gap closes, the tree is empty or a budget is spent."""
        states = self.moves.states
        starts = np.flatnonzero(((states == 0) | (states % 3 == 1)).all(axis=1))  # free, or just arrived
        for s in reversed(starts):  # of equals the last is expanded first: fingers without use stay free
            self._push_prefix((), int(s), 0.0, 0.0)
        return super().run(budget, node_limit)

    def _open(self, bound: float, node: Prefix | Node) -> None:
        if isinstance(node, Prefix):
            self._expand(bound, node)
        else:
            self._visit(bound, node)

    def _push_prefix(
        self, parent: tuple[tuple[int, ...], ...], state: int, forces: float, smooth: float
    ) -> None:
        t = len(parent[0]) if parent else 0
        states = self.moves.states[state]
        modes = tuple(
            (*(parent[c] if parent else ()), (s - 1) // 3 if s else FREE) for c, s in enumerate(states)
        )
        if any(modes[c] > modes[c + 1] for c in range(self.fingers - 1)):
            return  # the fingers are interchangeable
        bound = forces + smooth + float(self.windows[t, states].sum() + self.to_go[t, state])
        self._push(bound, Prefix(modes, state, forces))

    def _expand(self, bound: float, node: Prefix) -> None:
        """Settle the prefix's true smoothing cost; if it is still the least, branch to the next step."""
        t = len(node.modes[0]) - 1
        smooth = sum(self._least_smoothing(modes) for modes in node.modes)
        settled = max(bound, node.forces + smooth + self.to_go[t, node.state])
        if not node.settled and settled > bound * (1 + 1e-9) + 1e-12:
            return self._push(settled, Prefix(node.modes, node.state, node.forces, settled=True))
        self.nodes += 1
        if t == self.scaled.steps - 1:
            return self._plant(settled, node)
        for k in reversed(range(self.moves.start[node.state], self.moves.start[node.state + 1])):
            forces = node.forces + float(self.phi.cost[t, self.moves.active[k]])
            self._push_prefix(node.modes, int(self.moves.follow[k]), forces, smooth)
        return None

    def _least_smoothing(self, modes: tuple[int, ...]) -> float:
        """Least smoothing cost of one finger's modes, free positions outside the object: a small search over regions."""
        if modes not in self.smoothing:
            column = np.array(modes)[:, None]
            self.smoothing[modes] = self._outside(column, np.full_like(column, -1), np.inf)
        return self.smoothing[modes]

    def _outside(self, column: IntArray, assigned: IntArray, limit: float) -> float:
        bound, step, _ = least_smoothing(self.scaled, column, assigned)
        if step < 0 or bound >= limit:
            return bound
        least = limit
        for region in range(self.scaled.regions):
            assigned[step, 0] = region
            least = min(least, max(bound, self._outside(column, assigned, least)))
        assigned[step, 0] = -1
        return least

    def _plant(self, bound: float, prefix: Prefix) -> None:
        """Visit a complete sequence with its box narrowed to where every step can be balanced, if there is such a box."""
        sequence = sequence_of(self.scaled, np.array(prefix.modes).T.copy())
        lo, hi = sequence.lo.copy(), sequence.hi.copy()
        possible, removed = narrow(self.scaled, sequence, lo, hi)
        planted = Planted(sequence, removed, Node.root(sequence, lo, hi) if possible else None)
        self.planted.append(planted)
        if planted.rest is not None:
            self._visit(bound, planted.rest)
