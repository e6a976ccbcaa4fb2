"""Best-first search over boxes of contact positions and free regions of complete mode sequences.

The least bound in the heap bounds the task, so (best - bound) / best certifies the answer.  Every box keeps the proof of its
bound and the parts it was split into: the certificate that a checker can follow.
"""

import heapq
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from expert.budget import Budget
from expert.contact.box import Box
from expert.contact.polish import mend
from expert.contact.relaxation import Goal, Relaxed, relax
from expert.contact.scaled import ScaledTask
from expert.contact.sequence import Sequence
from expert.contact.smoothing import least_smoothing
from expert.contact.steps import CERTAIN
from expert.geometry.pose import Array

ROUNDS = 25
"""Master programs per visit of a box."""
NEGLIGIBLE = 1e-9
"""Costs are not told apart below this [`cost_unit`]: what costs nothing has no relative gap."""
MIDDLE = 0.35
"""A box is split where the relaxation's solution lies, but no nearer to an end than this share of its width."""
UNEVEN, SLIVER = 1 / 16, 1e-6
"""A range is not split while the share of it that is left is so much smaller than another's; ranges of less count as so wide."""


class AtRho(NamedTuple):
    """Parts below and above `at` of an interval's range."""

    interval: int
    at: float


class ByRegion(NamedTuple):
    """One part for each region that a free finger may be in at a step (3-CT7)."""

    step: int
    finger: int


class Proof(NamedTuple):
    """No plan in a box costs less than `bound` (inf: there is none): multipliers y (T, 3), accelerations (T - 2, C, 2)."""

    bound: float
    y: Array
    accelerations: Array


@dataclass(eq=False, slots=True)
class Node:
    """A box, widths of the ranges of rho that its sequence began with, the proof of its bound once it was visited, how it was split."""

    box: Box
    span: Array
    proof: Proof | None = None
    split: AtRho | ByRegion | None = None
    parts: list["Node"] = field(default_factory=list)

    @classmethod
    def root(cls, sequence: Sequence, lo: Array, hi: Array) -> "Node":
        """The box of a sequence, no region imposed."""
        return cls(Box(sequence, lo, hi, np.full_like(sequence.modes, -1)), hi - lo)

    def at_rho(self, interval: int, at: float) -> list["Node"]:
        """Split the range of an interval in two."""
        sequence, lo, hi, assigned = self.box
        below, above = hi.copy(), lo.copy()
        below[interval] = above[interval] = at
        self.split = AtRho(interval, at)
        boxes = (Box(sequence, lo, below, assigned), Box(sequence, above, hi, assigned))
        self.parts = [Node(box, self.span) for box in boxes]
        return self.parts

    def by_region(self, step: int, finger: int, regions: int) -> list["Node"]:
        """One part for each free region."""
        sequence, lo, hi, imposed = self.box
        self.split = ByRegion(step, finger)
        for region in range(regions):
            assigned = imposed.copy()
            assigned[step, finger] = region
            self.parts.append(Node(Box(sequence, lo, hi, assigned), self.span))
        return self.parts


@dataclass
class Best:
    """The incumbent, in units of 1 (cost of the model)."""

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
        self.heap: list[tuple[float, int, Any]] = []
        self.pushed = 0
        self.pruned = np.inf  # least bound of all that was cut off
        self.budget = Budget(np.inf)

    @property
    def cutoff(self) -> float:
        """Bounds at or above this cannot improve the best plan by more than the gap."""
        best = self.best.cost
        return best - max(self.gap * abs(best), NEGLIGIBLE) if np.isfinite(best) else np.inf

    def run(self, budget: Budget, node_limit: int | None = None) -> Outcome:
        """Search until the gap closes, the tree is empty or a budget is spent."""
        self.budget = budget
        while self.heap and self.heap[0][0] < self.cutoff:
            if budget.over or (node_limit is not None and self.nodes >= node_limit):
                return self._outcome(limited=True)
            bound, _, node = heapq.heappop(self.heap)
            self._open(bound, node)
        return self._outcome(limited=False)

    def offer(self, bound: float, sequence: Sequence, lo: Array, hi: Array) -> None:
        """Let the search visit a complete sequence over a box of contact positions; no plan in it costs less than `bound`."""
        self._push(bound, Node.root(sequence, lo, hi))

    def _open(self, bound: float, node: Any) -> None:
        self._visit(bound, node)

    def _outcome(self, limited: bool) -> Outcome:
        bound = min(self.heap[0][0] if self.heap else np.inf, self.pruned, self.best.cost)
        return Outcome(self.best, bound, self.nodes, limited)

    def _push(self, bound: float, node: Any) -> None:
        if bound >= self.cutoff:
            self.pruned = min(self.pruned, bound)
            return
        self.pushed += 1
        # ties: the deeper node first, so that plans are found early
        heapq.heappush(self.heap, (bound, -self.pushed, node))

    def _visit(self, bound: float, node: Node) -> None:
        """Bound the box; keep the best plan; split where the relaxation is loosest."""
        self.nodes += 1
        found = relax(self.scaled, node.box, Goal(self.cutoff, self.gap / 2, ROUNDS))
        node.proof = Proof(found.bound, found.y, found.accelerations)
        if found.cost < self.best.cost:
            self.best = Best(found.cost, node.box.sequence, found.z)
        bound = max(bound, found.bound)
        if bound >= self.cutoff:
            self.pruned = min(self.pruned, bound)
            return
        if not np.isfinite(found.cost):
            self._mend(node.box.sequence, found.last)
        for least, part in self._split(bound, node, found):
            self._push(least, part)

    def _mend(self, sequence: Sequence, z: Array) -> None:
        """A plan early: near the relaxation's solution, which has a finger inside the object or a step out of balance."""
        z, cost = mend(self.scaled, sequence, z, self.budget)
        if cost < self.best.cost:
            self.best = Best(cost, sequence, z)

    def _split(self, bound: float, node: Node, found: Relaxed) -> Iterator[tuple[float, Node]]:
        t, c, depth = found.intrusion
        if depth > 0:
            for part in node.by_region(t, c, self.scaled.regions):
                apart = found.forces + sum(bound for bound, _, _ in self._smoothest(part.box))
                yield max(bound, apart), part
            return
        width = node.box.hi - node.box.lo
        narrowest = CERTAIN / max(
            1.0, 4 * self.scaled.max_force
        )  # such a box is balanced everywhere or nowhere
        exact = found.chord_error.max(initial=0.0) <= 1e-6 * abs(found.bound)  # then the widest is split
        error = np.where(width > narrowest, width if exact else found.chord_error, -np.inf)
        if error.max(initial=-np.inf) <= 0:
            self.pruned = min(self.pruned, bound)  # too narrow to split: it stays open
            return
        k = int(error.argmax())
        share = np.where(width > narrowest, width / np.maximum(node.span, SLIVER), 0.0)
        if (
            share[k] < UNEVEN * share.max()
        ):  # an error that is seen at one place only would cut slices without end
            k = int(share.argmax())
        room = MIDDLE * width[k]
        at = float(np.clip(found.last[k], node.box.lo[k] + room, node.box.hi[k] - room))
        for part in node.at_rho(k, at):
            yield bound, part

    def _smoothest(self, box: Box) -> list[tuple[float, int, Array]]:
        """Bounds of each finger's smoothing cost by itself."""
        modes, assigned = box.sequence.modes, box.assigned
        columns = [slice(c, c + 1) for c in range(self.fingers)]
        return [least_smoothing(self.scaled, modes[:, c].copy(), assigned[:, c].copy()) for c in columns]

    def proof_apart(self, box: Box) -> Proof:
        """Bound of a box that was not visited, from its steps and each finger's smoothing by themselves."""
        found, paths = relax(self.scaled, box, Goal(np.inf, 0.0, 0)), self._smoothest(box)
        slopes = np.stack([slopes for _, _, slopes in paths], axis=1)
        return Proof(found.forces + sum(bound for bound, _, _ in paths), found.y, slopes)
