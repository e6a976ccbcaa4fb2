"""Dead ends: configurations at which moving fingers leave the object nowhere to go (local maxima of s over free space)."""

import itertools
from dataclasses import dataclass

import numpy as np

from expert.budget import UNLIMITED, Budget
from expert.errors import OutOfTime, SolverFailed
from expert.geometry.polygon import signed_distance
from expert.geometry.pose import Array, rotation
from expert.verify.grasp.event_kernel import EVENT, TOUCH, Candidates, closing_with
from expert.verify.grasp.finger_path import FingerPath

AT_GOAL = 1e-6
"""An end this close to the goal, in relative lengths and rad, is the goal."""
STRICT = 1e-6
"""Contacts that meet all conditions by this, in relative lengths and weights, do so whatever the rounding."""
MOST = 20_000


@dataclass(frozen=True, kw_only=True)
class DeadEndEvent:
    """At path parameter s the free space around `first` to `last` vanishes.

    first, last: relative configurations (3,) between which the object can still slide at that moment; equal where it
    cannot.  contacts: (finger, facet) pairs that close.  strict: whether they do beyond all tolerances; an event that is not
    may be none.
    """

    s: float
    first: Array
    last: Array
    contacts: tuple[tuple[int, int], ...]
    strict: bool

    def configurations(self, count: int) -> Array:
        """So many configurations (count, 3) from the first to the last."""
        return self.first + np.linspace(0, 1, count)[:, None] * (self.last - self.first)

    def inner_configurations(self, count: int) -> Array:
        """So many configurations (count, 3) between the first and the last; at these a finger may slip round a corner."""
        return self.configurations(count + 2)[1:-1]


def dead_end_events(path: FingerPath, budget: Budget = UNLIMITED) -> list[DeadEndEvent]:
    """All dead ends along a finger path but the goal itself, reachable or not, in order of s.

    Nested cages may contain some, in which starts get stuck: what 5.2 Remark 1 overlooks.

    Raises SolverFailed where there are more than can be listed, OutOfTime where the budget is over before they are known.
    """
    contacts, events = _closing(path, budget)
    free = [(event, interval) for event in events for interval in _free_intervals(path, event)]
    ends = [_dead_end(path, contacts, event, interval) for event, interval in free]
    return _distinct([end for end in ends if not _is_passed(path, end)])


def _closing(path: FingerPath, budget: Budget) -> tuple[np.ndarray, np.ndarray]:
    """Contacts (C, 2) and the kernel's events (EVENT)."""
    facets, fingers = path.facets, path.knots.shape[1]
    count = len(facets.offsets)
    contacts = np.array([(i, j) for i in range(fingers) for j in range(count)])
    finger, facet = contacts.T
    after = (facet[None] == (facet[:, None] + 1) % count) & facets.reflex[facet][None]
    compatible = (finger[:, None] != finger[None]) | after | after.T
    events = np.empty(MOST, EVENT)
    candidates = Candidates(contacts, compatible, facets, np.ascontiguousarray(path.knots))
    found = 0
    for first in range(len(contacts)):
        if budget.over:
            raise OutOfTime("the budget was spent before all dead ends were known")
        found = closing_with(candidates, first, events, found)
    if found == MOST:
        raise SolverFailed(f"more than {MOST} dead ends: the finger path is degenerate")
    return contacts, events[:found]


def _free_intervals(path: FingerPath, event: np.void) -> list[tuple[float, float]]:
    """Parts of the slide (or (0, 0) where there is none) on which no finger is inside the object."""
    turn = rotation(event["angle"])
    seen = (path.fingers(event["segment"] + event["fraction"]) - [event["x"], event["y"]]) @ turn
    if not event["slides"]:
        return [(0.0, 0.0)] if signed_distance(path.vertices, seen).min() >= -TOUCH else []
    low, high = event["slide_from"], event["slide_to"]
    step = (
        -np.array([event["slide_x"], event["slide_y"]]) @ turn
    )  # of the fingers, seen from the object that slides on
    cuts = np.unique(np.clip([low, high, *_crossings(path.vertices, seen, step)], low, high))
    middles = 0.5 * (cuts[1:] + cuts[:-1])
    places = seen[None] + middles[:, None, None] * step
    outside = signed_distance(path.vertices, places).min(axis=1) >= -TOUCH
    ends = itertools.pairwise(cuts)
    parts: list[tuple[float, float]] = []
    for (a, b), out in zip(ends, outside, strict=True):
        if out and parts and parts[-1][1] == a:
            parts[-1] = (parts[-1][0], b)
        elif out:
            parts.append((a, b))
    return parts


def _crossings(vertices: Array, points: Array, step: Array) -> list[float]:
    """Parameters at which points + t step cross lines through the polygon's edges."""
    e = np.roll(vertices, -1, axis=0) - vertices
    across = step[0] * e[:, 1] - step[1] * e[:, 0]
    crossed = np.abs(across) > 1e-12
    gap = vertices[crossed][None] - points[:, None]
    t = (gap[..., 0] * e[crossed, 1] - gap[..., 1] * e[crossed, 0]) / across[crossed]
    return [float(x) for x in t.ravel()]


def _dead_end(
    path: FingerPath, contacts: np.ndarray, event: np.void, interval: tuple[float, float]
) -> DeadEndEvent:
    x, y, angle = event["x"], event["y"], event["angle"]
    ends = [np.array([x + t * event["slide_x"], y + t * event["slide_y"], angle]) for t in interval]
    touched = contacts[event["contacts"][: event["count"]]]
    long = not event["slides"] or interval[1] - interval[0] > 10 * STRICT  # or only ends of facets touch
    return DeadEndEvent(
        s=float(event["segment"] + event["fraction"]),
        first=ends[0],
        last=ends[1],
        contacts=tuple((int(i), int(j)) for i, j in touched),
        strict=bool(long and event["clear"] > STRICT),
    )


def _is_passed(path: FingerPath, end: DeadEndEvent) -> bool:
    """Whether the object is at the goal, or may stay, up to rounding, while the fingers go on for a segment."""
    if np.abs(end.configurations(2)).max() <= AT_GOAL:
        return True
    k, t = path.segment(end.s)
    stop = min(k + (2 if t > 1 - 1e-6 else 1), path.last)
    return stop - end.s > 1e-6 and bool((path.deepest(end.configurations(5), end.s, stop) <= TOUCH).all())


def _distinct(ends: list[DeadEndEvent]) -> list[DeadEndEvent]:
    """In order of s; of those that are the same, a strict one if there is one."""
    kept: list[DeadEndEvent] = []
    for end in sorted(ends, key=lambda e: not e.strict):
        same = (
            abs(end.s - k.s) < 1e-7
            and np.abs(end.first - k.first).max() < 1e-6
            and np.abs(end.last - k.last).max() < 1e-6
            for k in kept
        )
        if not any(same):
            kept.append(end)
    return sorted(kept, key=lambda e: e.s)
