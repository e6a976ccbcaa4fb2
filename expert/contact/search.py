"""Best-first search over contact modes, contact positions and free regions: the exact solver's tree.

A node is a prefix of modes, bounded by its forces so far, each finger's least smoothing cost and the cost-to-go; or a
complete mode sequence with a box of contact positions and, where needed, regions for free fingers.  The least bound in
the heap bounds the task, so (best - bound) / best certifies the answer.
"""

import heapq
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from expert.budget import Budget
from expert.contact.box import Relaxed, narrow, relax
from expert.contact.modes import Moves, cost_to_go, last_costs, moves_of, step_costs, window_costs
from expert.contact.polish import mend
from expert.contact.scaled import ScaledTask
from expert.contact.sequence import Sequence, least_smoothing, sequence_of
from expert.geometry.pose import Array
from expert.problems.contact import FREE
from expert.world.values import IntArray

ROUNDS = 25
"""Master programs per visit of a complete sequence."""
NEGLIGIBLE = 1e-9
"""Costs are not told apart below this [(m g)^2]: what costs nothing has no relative gap."""
MIDDLE = 0.35
"""A box is split where the relaxation's solution lies, but no nearer to an end than this share of its width."""
NARROWEST = 1e-9
"""Boxes are not split below this width of rho."""


@dataclass(frozen=True)
class Prefix:
    """Modes of the first steps, one tuple per finger; joint automaton state; cost of the forces before the last step."""

    modes: tuple[tuple[int, ...], ...]
    state: int
    forces: float
    settled: bool = False


@dataclass(frozen=True)
class Leaf:
    """Complete modes over a box lo <= rho <= hi; assigned (T, C): region of a free finger or -1."""

    sequence: Sequence
    lo: Array
    hi: Array
    assigned: IntArray


@dataclass
class Best:
    """The incumbent, in units of 1 (cost of the scaled)."""

    cost: float = np.inf
    sequence: Sequence | None = None
    z: Array = field(default_factory=lambda: np.empty(0))


@dataclass(frozen=True)
class Outcome:
    """What the search found; bound: no plan costs less (inf: there is none); limited: a budget was spent."""

    best: Best
    bound: float
    nodes: int
    limited: bool


class Tree:
    """Complete mode sequences, visited best first; whoever grows it says which (`Search`: all of them)."""

    def __init__(self, scaled: ScaledTask, fingers: int, gap: float) -> None:
        self.scaled, self.fingers, self.gap = scaled, fingers, gap
        self.best, self.nodes = Best(), 0
        self.heap: list[tuple[float, int, Prefix | Leaf]] = []
        self.pushed = 0
        self.pruned = np.inf  # least bound of all that was cut off

    @property
    def cutoff(self) -> float:
        """Bounds at or above this cannot improve the best plan by more than the gap."""
        best = self.best.cost
        return best - max(self.gap * abs(best), NEGLIGIBLE) if np.isfinite(best) else np.inf

    def run(self, budget: Budget, node_limit: int | None = None) -> Outcome:
        """Search until the gap closes, the tree is empty or a budget is spent."""
        while self.heap and self.heap[0][0] < self.cutoff:
            if budget.over or (node_limit is not None and self.nodes >= node_limit):
                return self._outcome(limited=True)
            bound, _, node = heapq.heappop(self.heap)
            self._open(bound, node)
        return self._outcome(limited=False)

    def offer(self, bound: float, sequence: Sequence, lo: Array, hi: Array) -> None:
        """Let the search visit a complete sequence over a box of contact positions; no plan in it costs less than `bound`."""
        self._push(bound, Leaf(sequence, lo, hi, np.full_like(sequence.modes, -1)))

    def _open(self, bound: float, node: Prefix | Leaf) -> None:
        if isinstance(node, Leaf):
            self._visit(bound, node)

    def _outcome(self, limited: bool) -> Outcome:
        bound = min(self.heap[0][0] if self.heap else np.inf, self.pruned, self.best.cost)
        return Outcome(self.best, bound, self.nodes, limited)

    def _push(self, bound: float, node: Prefix | Leaf) -> None:
        if bound >= self.cutoff:
            self.pruned = min(self.pruned, bound)
            return
        self.pushed += 1
        # ties: the deeper node first, so that plans are found early
        heapq.heappush(self.heap, (bound, -self.pushed, node))

    def _visit(self, bound: float, leaf: Leaf) -> None:
        """Bound the box; keep the best plan; split where the relaxation is loosest."""
        self.nodes += 1
        found = self._relax(leaf)
        bound = max(bound, found.bound)
        if bound >= self.cutoff:
            self.pruned = min(self.pruned, bound)
            return
        if not np.isfinite(found.cost):
            self._mend(leaf, found.last)
        for least, child in self._children(bound, leaf, found):
            self._push(least, child)

    def _relax(self, leaf: Leaf) -> Relaxed:
        found = relax(
            self.scaled, leaf.sequence, leaf.lo, leaf.hi, leaf.assigned, self.cutoff, self.gap / 2, ROUNDS
        )
        if found.cost < self.best.cost:
            self.best = Best(found.cost, leaf.sequence, found.z)
        return found

    def _mend(self, leaf: Leaf, z: Array) -> None:
        """A plan early: near the relaxation's solution, which has a finger inside the object or a step out of balance."""
        z, cost = mend(self.scaled, leaf.sequence, z)
        if cost < self.best.cost:
            self.best = Best(cost, leaf.sequence, z)

    def _children(self, bound: float, leaf: Leaf, found: Relaxed) -> Iterator[tuple[float, Leaf]]:
        t, c, depth = found.intrusion
        if depth > 0:
            for region in range(self.scaled.region.shape[1]):
                assigned = leaf.assigned.copy()
                assigned[t, c] = region
                apart = found.forces + self._assigned_smoothing(leaf.sequence.modes, assigned)
                yield max(bound, apart), Leaf(leaf.sequence, leaf.lo, leaf.hi, assigned)
            return
        width = leaf.hi - leaf.lo
        exact = found.chord_error.max(initial=0.0) <= 1e-6 * abs(found.bound)  # then the widest is split
        error = np.where(width > NARROWEST, width if exact else found.chord_error, -np.inf)
        if error.max(initial=-np.inf) <= 0:
            self.pruned = min(self.pruned, bound)  # too narrow to split: it stays open
            return
        k = int(error.argmax())
        room = MIDDLE * width[k]
        at = float(np.clip(found.last[k], leaf.lo[k] + room, leaf.hi[k] - room))
        for lo, hi in ((leaf.lo[k], at), (at, leaf.hi[k])):
            low, high = leaf.lo.copy(), leaf.hi.copy()
            low[k], high[k] = lo, hi
            yield bound, Leaf(leaf.sequence, low, high, leaf.assigned)

    def _assigned_smoothing(self, modes: IntArray, assigned: IntArray) -> float:
        return sum(
            least_smoothing(self.scaled, modes[:, c : c + 1].copy(), assigned[:, c : c + 1].copy())[0]
            for c in range(self.fingers)
        )


class Search(Tree):
    """The tree of all mode sequences, grown from prefixes, and its tables for one task."""

    def __init__(self, scaled: ScaledTask, fingers: int, gap: float) -> None:
        super().__init__(scaled, fingers, gap)
        self.moves: Moves = moves_of(scaled.facets, fingers, scaled.min_interval)
        self.phi = step_costs(scaled, fingers)
        self.windows = window_costs(scaled)
        self.to_go = cost_to_go(self.phi, self.windows, self.moves, last_costs(scaled, self.phi, self.moves))
        self.smoothing: dict[tuple[int, ...], float] = {}

    def run(self, budget: Budget, node_limit: int | None = None) -> Outcome:
        """Search until the gap closes, the tree is empty or a budget is spent."""
        states = self.moves.states
        starts = np.flatnonzero(((states == 0) | (states % 3 == 1)).all(axis=1))  # free, or just arrived
        for s in reversed(starts):  # of equals the last is expanded first: fingers without use stay free
            self._push_prefix((), int(s), 0.0, 0.0)
        return super().run(budget, node_limit)

    def _open(self, bound: float, node: Prefix | Leaf) -> None:
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
            forces = node.forces + float(self.phi[t, self.moves.active[k]])
            self._push_prefix(node.modes, int(self.moves.follow[k]), forces, smooth)
        return None

    def _least_smoothing(self, modes: tuple[int, ...]) -> float:
        """Least smoothing cost of one finger's modes, free positions outside the object: a small search over regions."""
        if modes not in self.smoothing:
            column = np.array(modes)[:, None]
            self.smoothing[modes] = self._outside(column, np.full_like(column, -1), np.inf)
        return self.smoothing[modes]

    def _outside(self, column: IntArray, assigned: IntArray, limit: float) -> float:
        bound, t = least_smoothing(self.scaled, column, assigned)
        if t < 0 or bound >= limit:
            return bound
        least = limit
        for region in range(self.scaled.region.shape[1]):
            assigned[t, 0] = region
            least = min(least, max(bound, self._outside(column, assigned, least)))
        assigned[t, 0] = -1
        return least

    def _plant(self, bound: float, node: Prefix) -> None:
        """Visit a complete sequence with its box narrowed to where every step can be balanced, if there is such a box."""
        sequence = sequence_of(self.scaled, np.array(node.modes).T.copy())
        lo, hi = sequence.lo.copy(), sequence.hi.copy()
        if narrow(self.scaled, sequence, lo, hi):
            self._visit(bound, Leaf(sequence, lo, hi, np.full_like(sequence.modes, -1)))
