"""Pockets of free space that vanish in a dead end: configurations in them, followed backwards from the dead end.

Whether a flood reaches a dead end is decided long before, where its pocket parts from what the goal is in.  A flood that
knows where it must not be can tell there that its cells are too wide.  Nothing is proved here, and nothing depends on it
but the time that a proof takes.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from expert.geometry.pose import Array
from expert.verify.grasp.dead_ends import DeadEndEvent
from expert.verify.grasp.finger_path import FingerPath

LEAST_STEP = 1e-3
"""Fingers go back by at least this relative length at a time."""
TRIED = 64
"""Configurations around the last one, of which the one with most room comes next."""
MOST_STEPS = 300


@dataclass(frozen=True)
class Pockets:
    """Relative configurations (M, 3), free while s is in [since, until] (M,)."""

    configurations: Array
    since: Array
    until: Array

    @classmethod
    def before(cls, path: FingerPath, events: Sequence[DeadEndEvent]) -> "Pockets":
        """Those of some dead ends."""
        rows = [row for event in events for row in _followed_back(path, event)]
        table = np.array(rows).reshape(-1, 5)
        return cls(table[:, :3], table[:, 3], table[:, 4])

    def at(self, low: float, high: float) -> Array:
        """Configurations (m, 3) that are in pockets somewhere in [low, high]."""
        return self.configurations[(self.since <= high) & (self.until >= low)]


NONE = Pockets(np.empty((0, 3)), np.empty(0), np.empty(0))


def _followed_back(path: FingerPath, event: DeadEndEvent) -> Iterator[Array]:
    """Rows (5,): a configuration, and from when to when it is free."""
    rng = np.random.default_rng(0)
    place, s = event.configurations(3)[1], event.s
    for _ in range(MOST_STEPS):
        k = max(int(np.ceil(s)) - 1, 0)  # the segment that ends at s or beyond
        speed = max(float(np.linalg.norm(path.knots[k + 1] - path.knots[k], axis=1).max()), 1e-9)
        room = float(path.gap(place[None], s)[0])
        if room > 0:
            yield np.array([*place, max(s - room / speed, k), min(s + room / speed, k + 1, event.s)])
        if s <= 0:
            return
        step = max(0.5 * room, LEAST_STEP)
        s = max(s - step / speed, 0.0)
        around = place + 2 * step * rng.normal(size=(TRIED, 3)) * np.linspace(0, 1, TRIED)[:, None]
        place = around[path.gap(around, s).argmax()]
