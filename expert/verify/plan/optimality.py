"""Proves again, from multipliers and without a solver, that no contact plan costs less than a bound, or that there is none.

All mode sequences are walked through, prefix by prefix; fingers being equal, those of lexicographically ordered modes are enough.
A prefix is left when what its forces and each finger's motion cost so far, plus the least cost to go, reaches the bound.  A
complete sequence needs a proof of its own: its contact positions and free regions are split into parts as the certificate says,
every split into all of its parts, and each part has multipliers whose dual value is at least the bound.  The certificate is
data from outside: whatever it says, only what these sums show is believed.
"""

import itertools
from typing import Any

import numpy as np
import shapely

from expert.geometry.convex import free_regions
from expert.geometry.cover import clip
from expert.geometry.pose import Array
from expert.problems.contact import ContactTask
from expert.verify.plan.boxes import Boxes, Modes, Regions, Unproved, intervals, numbers, parts
from expert.verify.plan.duality import ROUNDING, Duality, cost_unit
from expert.verify.plan.mode_automaton import Automaton, mode, window_costs

CLOSE = 1e-8
"""A bound counts as proved if it is up to this share of itself."""
GRID = 1e-11
"""Relative width of the grid on which areas are compared."""


def objection(task: ContactTask, certificate: Any, bound: float) -> str:
    """Why a certificate does not prove that no plan costs less than `bound` (SI; inf: that there is none); empty: it does."""
    if not covers_the_outside(task):
        return "the free regions do not cover the outside of the object"
    target = bound / cost_unit(task)
    if target == -np.inf:
        return "there is no bound to prove"
    if np.isfinite(target):
        target -= CLOSE * abs(target)
    try:
        Walk(task, certificate).require(target)
    except Unproved as error:
        return str(error)
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError, RecursionError):
        return "the certificate is malformed"
    return ""


class Walk:
    """The walk through all mode sequences with what a certificate says of them."""

    def __init__(self, task: ContactTask, certificate: dict[str, Any]) -> None:
        self.bounds, self.fingers = Duality(task), task.fingers.count
        self.boxes = Boxes(self.bounds)
        self.moves = Automaton(self.bounds.facets, self.fingers, task.robustness.min_interval)
        if not self.moves.fits:
            raise Unproved("there are too many contact sequences to look at")
        self.paths = {tuple(path["modes"]): path for path in certificate["paths"]}
        self.sequences = {tuple(map(tuple, proof["modes"])): proof for proof in certificate["sequences"]}
        self.step_costs = self._step_costs(certificate["steps"])
        self.windows = window_costs(self.bounds)
        self.to_go = self.moves.cost_to_go(self.step_costs, self.windows)
        self._smooth: dict[Modes, float] = {}

    def _step_costs(self, packed: str) -> Array:
        """Bounds (T, sets) of the force cost of each step with each set of active facets, places anywhere in their ranges."""
        b, sets = self.bounds, self.moves.sets
        y = numbers(packed, (b.steps, len(sets), 3))
        free = 0.0 if b.beta == 0 else -np.inf  # only the distance from the cone's edge is a reward
        costs = np.empty((b.steps, len(sets)))
        for t, (k, chosen) in itertools.product(range(b.steps), enumerate(sets)):
            costs[t, k] = max(free, self._step_cost(t, [f - 1 for f in chosen if f], y[t, k]))
        return costs

    def _step_cost(self, t: int, facets: list[int], y: Array) -> float:
        b = self.bounds
        if any(b.low[t, f] > b.high[t, f] for f in facets):
            return np.inf
        needed, size = b.balance(t, y)
        for free_of_cost in (True, False):
            gains = [
                max(b.gain(t, f, r, y, free_of_cost) for r in (b.low[t, f], b.high[t, f])) for f in facets
            ]
            value = needed - sum(gains) - ROUNDING * (size + sum(map(abs, gains)))
            if free_of_cost and value > 0:
                return np.inf
        return value

    def require(self, target: float) -> None:
        """Raise Unproved unless every sequence is shown to cost at least the target, or to be impossible."""
        waiting: list[tuple[tuple[Modes, ...], tuple[int, ...], float]] = [
            (tuple((mode(s),) for s in now), now, 0.0)
            for now in itertools.product(self.moves.follow[0], repeat=self.fingers)
        ]
        while waiting:
            prefixes, now, forces = waiting.pop()
            if any(a > b for a, b in itertools.pairwise(prefixes)):
                continue  # the same fingers in another order
            t = len(prefixes[0]) - 1
            least = forces + sum(self._smoothing(p, s) for p, s in zip(prefixes, now, strict=True))
            if least + self.to_go[(t, *now)] >= target:
                continue
            if t == self.bounds.steps - 1:
                self._require_sequence(np.array(prefixes).T, target)
                continue
            for after in itertools.product(*(self.moves.follow[s] for s in now)):
                grown = tuple((*p, mode(s)) for p, s in zip(prefixes, after, strict=True))
                waiting.append((grown, after, forces + self.step_costs[t, self.moves.active(now, after)]))

    def _require_sequence(self, modes: Array, target: float) -> None:
        proof = self.sequences.get(tuple(map(tuple, modes.tolist())))
        if proof is None:
            raise Unproved(f"the certificate says nothing about the contact sequence {modes.tolist()}")
        self.boxes.require(modes, proof, target)

    def _smoothing(self, path: Modes, state: int) -> float:
        """Least smoothing cost of one finger's modes so far: what the certificate proves, or that of each step by itself."""
        if path not in self._smooth:
            before = path[:-1]
            cost = self._smooth.get(before, 0.0) + float(self.windows[len(before), state])
            if path in self.paths:
                cost = max(cost, self._path(path, self.paths[path], {}))
            self._smooth[path] = cost
        return self._smooth[path]

    def _path(self, path: Modes, proof: dict[str, Any], regions: Regions) -> float:
        """Bound of one finger's smoothing cost, by cases of the regions that it is in."""
        if "parts" in proof:
            step, cases = int(proof["step"]), parts(proof, self.bounds.regions)
            return min(self._path(path, case, {**regions, (step, 0): r}) for r, case in enumerate(cases))
        a = numbers(proof["accelerations"], (max(len(path) - 2, 0), 1, 2))
        modes = np.array(path)[:, None]
        spans = self.boxes.spans(modes)
        if any(low > high for low, high in spans):
            return np.inf
        value, size = self.boxes.motion(modes, a, regions)
        for (steps, _, f), (low, high) in zip(intervals(modes), spans, strict=True):
            pull = self.bounds.pulls(a[:, 0])
            ends = [sum(float(pull[t] @ self.bounds.place(t, f, r)) for t in steps) for r in (low, high)]
            value, size = value + min(ends), size + max(map(abs, ends))
        return max(0.0, value - ROUNDING * size)


def covers_the_outside(task: ContactTask) -> bool:
    """Whether the free regions leave out nothing but the object, its outline moved out by the clearance of free fingers."""
    vertices, clearance, size = task.body.vertices, task.robustness.free_clearance, task.body.size
    far = 4 * (size + clearance) * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    pieces = [clip(far, region.A, region.b) for region in free_regions(vertices, clearance)]
    covering = [shapely.Polygon(piece) for piece in pieces if len(piece) > 2]
    covering.append(shapely.Polygon(vertices).buffer(clearance, join_style="mitre", mitre_limit=1e3))
    # on a grid, since edges of both all but coincide, on which overlays in plain doubles may fail
    covered = shapely.union_all(covering, grid_size=GRID * size)
    return bool(shapely.Polygon(far).area - covered.area <= 1e-9 * size**2)
