"""What contact modes may follow each other, and least costs to go over them (Thesis 3-CT5).

State of a finger: 0 free, or 1 + 3 f + a: on facet f for the first (a = 0), the second (a = 1) or a later step (a = 2).  A finger
leaves a facet before it takes another one; it pushes at t if it is on the same facet at t + 1, or if t is the last step.
"""

import itertools
from functools import cached_property

import numpy as np

from expert.geometry.pose import Array
from expert.problems.contact import FREE
from expert.verify.plan.duality import Duality
from expert.world.values import IntArray

MOST_MOVES = 2_000_000
"""Joint moves of all fingers that are looked at."""


class Automaton:
    """Moves of `fingers` equal fingers; their active sets are multisets of 1 + facet, or 0 for a finger that does not push."""

    def __init__(self, facets: int, fingers: int, min_interval: int) -> None:
        self.facets, self.fingers, self.min_interval = facets, fingers, min_interval
        self.sets = list(itertools.combinations_with_replacement(range(facets + 1), fingers))
        self.set_index = {chosen: k for k, chosen in enumerate(self.sets)}
        takes = [1 + 3 * f for f in range(facets)]
        self.follow: list[list[int]] = [[0, *takes]]
        for first in takes:
            leave = [0] if min_interval == 1 else []
            self.follow += [[*leave, first + 1], [0, first + 2], [0, first + 2]]

    @property
    def fits(self) -> bool:
        """Whether there are few enough moves to look at all of them."""
        return sum(map(len, self.follow)) ** self.fingers <= MOST_MOVES

    def active(self, now: tuple[int, ...], after: tuple[int, ...]) -> int:
        """Index of the set of fingers that push between two joint states."""
        pushing = ((a + 2) // 3 if a and b else 0 for a, b in zip(now, after, strict=True))
        return self.set_index[tuple(sorted(pushing))]

    def active_last(self, now: tuple[int, ...]) -> int | None:
        """The same at the last step; None where a contact would be too short."""
        if self.min_interval > 1 and any(a and a % 3 == 1 for a in now):
            return None
        return self.set_index[tuple(sorted((a + 2) // 3 for a in now))]

    @cached_property
    def _moves(self) -> tuple[IntArray, IntArray, IntArray]:
        """All joint moves: from, to, and which set pushes."""
        pairs = [(a, b) for a, after in enumerate(self.follow) for b in after]
        single = np.array([(a, b, (a + 2) // 3 if a and b else 0) for a, b in pairs])
        chosen = np.indices((len(single),) * self.fingers).reshape(self.fingers, -1)
        before, after, pushing = (single[chosen, k] for k in range(3))
        place = len(self.follow) ** np.arange(self.fingers)[::-1]
        return place @ before, place @ after, self._numbered(pushing)

    def _numbered(self, pushing: IntArray) -> IntArray:
        """Indices of the sets in columns of (C, M)."""
        place = (self.facets + 1) ** np.arange(self.fingers)[::-1]
        table = np.empty((self.facets + 1) ** self.fingers, dtype=np.int64)
        table[np.array(self.sets) @ place] = np.arange(len(self.sets))
        return np.asarray(table[place @ np.sort(pushing, axis=0)], dtype=np.int64)

    def cost_to_go(self, step_costs: Array, windows: Array) -> Array:
        """Least force cost from t on plus smoothing cost after t, (T, one axis per finger), from each joint state.

        step_costs (T, sets); windows (T, states): what a finger's state costs on arrival.
        """
        states = len(self.follow)
        joint = np.array(list(itertools.product(range(states), repeat=self.fingers)))
        last = [self.active_last(tuple(now)) for now in joint.tolist()]
        value = np.array([np.inf if k is None else step_costs[-1, k] for k in last])
        all_steps = [value]
        before, after, pushing = self._moves
        for t in range(len(step_costs) - 2, -1, -1):
            arriving = value + windows[t + 1][joint].sum(axis=1)
            value = np.full(len(joint), np.inf)
            np.minimum.at(value, before, step_costs[t, pushing] + arriving[after])
            all_steps.append(value)
        return np.array(all_steps[::-1]).reshape(-1, *(states,) * self.fingers)


def mode(state: int) -> int:
    """Facet, or FREE."""
    return (state - 1) // 3 if state else FREE


def window_costs(bounds: Duality) -> Array:
    """Least smoothing cost at t of a finger that sat on f since t - 2, (T, states); inf where it cannot be on f at all."""
    T, F = bounds.low.shape
    cost = np.zeros((T, 1 + 3 * F))
    for age in range(3):
        since = [np.maximum(np.arange(T) - k, 0) for k in range(age + 1)]
        low, high = (
            np.max([bounds.low[s] for s in since], axis=0),
            np.min([bounds.high[s] for s in since], axis=0),
        )
        cost[:, 1 + age :: 3] = np.where(low <= high, 0.0, np.inf)
    for t in range(2, T):
        p0, p1 = (x[t] - 2 * x[t - 1] + x[t - 2] for x in (bounds.start, bounds.edge))
        low, high = bounds.low[t - 2 : t + 1].max(axis=0), bounds.high[t - 2 : t + 1].min(axis=0)
        rho = -(p0 * p1).sum(axis=1) / np.maximum((p1 * p1).sum(axis=1), 1e-300)
        rho = np.clip(rho, low, np.maximum(low, high))
        cost[t, 3::3] += bounds.smooth_weight * ((p0 + rho[:, None] * p1) ** 2).sum(axis=1)
    return cost
