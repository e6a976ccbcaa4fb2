"""Proofs about complete mode sequences: boxes of contact positions and free regions, and the multipliers that bound them."""

import base64
import itertools
from typing import Any

import numpy as np

from expert.geometry.pose import Array
from expert.problems.contact import FREE
from expert.verify.plan.duality import ROUNDING, Duality

LARGEST = 1e60
"""Of multipliers and accelerations."""
Modes = tuple[int, ...]
Regions = dict[tuple[int, int], int]
Interval = tuple[range, int, int]
"""Steps of a contact, its finger and facet."""
Spans = list[tuple[float, float]]
"""Ranges of rho, contact by contact."""
LOW, HIGH, ALL = 0, 1, 2
"""Which piece of a range is cut off."""


class Unproved(Exception):
    """Why a certificate does not prove the bound."""


class Boxes:
    """What certificates say of boxes, with the bounds of one task."""

    def __init__(self, bounds: Duality) -> None:
        self.bounds = bounds

    def require(self, modes: Array, proof: dict[str, Any], target: float) -> None:
        """Raise Unproved unless a sequence (T, C) is shown to cost at least the target, or to be impossible."""
        spans: Spans | None = self.spans(modes)
        if spans is not None and all(low <= high for low, high in spans):
            spans = self._without_removed(modes, proof["removed"], spans)
            if spans is not None:
                self._require_box(modes, proof, spans, {}, target)

    def _without_removed(self, modes: Array, removed: dict[str, Any], spans: Spans) -> Spans | None:
        """What is left of a box when the pieces that admit no balance are cut off one after the other; None: nothing."""
        count = len(removed["step"])
        at, y = numbers(removed["at"], (count,)), numbers(removed["multipliers"], (count, 3))
        listed = zip(removed["step"], removed["interval"], removed["part"], strict=True)
        for i, (t, k, part) in enumerate(listed):
            low, high = spans[k]
            if t < 0 or k < 0 or (part != ALL and not low <= at[i] <= high):
                raise Unproved("a piece is cut off outside of its range")
            below, above = (low, float(at[i])), (float(at[i]), high)
            piece, rest = (
                (below, above) if part == LOW else (above, below) if part == HIGH else (spans[k], None)
            )
            if not self._is_impossible(modes, t, y[i], [*spans[:k], piece, *spans[k + 1 :]]):
                raise Unproved(f"a piece is cut off that may balance step {t} of {modes.tolist()}")
            if rest is None:
                return None
            spans = [*spans[:k], rest, *spans[k + 1 :]]
        return spans

    def _is_impossible(self, modes: Array, t: int, y: Array, spans: Spans) -> bool:
        """Whether multipliers prove that a step has no balance anywhere in a box."""
        b, last = self.bounds, len(modes) - 1
        needed, size = b.balance(t, y)
        gains = [
            max(b.gain(t, f, rho, y, True) for rho in span)
            for (steps, _, f), span in zip(intervals(modes), spans, strict=True)
            if t in steps and (t == last or t + 1 in steps)
        ]
        return needed - sum(gains) > ROUNDING * (size + sum(map(abs, gains)))

    def spans(self, modes: Array) -> Spans:
        """Ranges of rho of the contacts of a sequence (T, C), in their order: finger by finger."""
        b = self.bounds
        return [(float(b.low[s, f].max()), float(b.high[s, f].min())) for s, _, f in intervals(modes)]

    def _require_box(
        self,
        modes: Array,
        proof: dict[str, Any],
        spans: Spans,
        regions: Regions,
        target: float,
    ) -> None:
        """Ranges `spans` of rho and regions of free fingers: split as the certificate says, or bounded by its multipliers."""
        if "interval" in proof:
            k, at = int(proof["interval"]), float(proof["at"])
            low, high = spans[k]
            if k < 0 or not low <= at <= high:
                raise Unproved("a range is split outside of itself")
            for part, span in zip(parts(proof, 2), ((low, at), (at, high)), strict=True):
                self._require_box(modes, part, [*spans[:k], span, *spans[k + 1 :]], regions, target)
        elif "parts" in proof:
            place = int(proof["step"]), int(proof["finger"])
            if min(place) < 0 or modes[place] != FREE:
                raise Unproved("a region is asked of a finger that is on a facet")
            for r, part in enumerate(parts(proof, self.bounds.regions)):
                self._require_box(modes, part, spans, {**regions, place: r}, target)
        elif not self._bounded(modes, proof, spans, regions, target):
            raise Unproved(
                f"its multipliers do not prove the bound for the contact sequence {modes.tolist()}"
            )

    def _bounded(
        self,
        modes: Array,
        proof: dict[str, Any],
        spans: Spans,
        regions: Regions,
        target: float,
    ) -> bool:
        T, C = modes.shape
        y = numbers(proof["multipliers"], (T, 3))
        a = numbers(proof["accelerations"], (max(T - 2, 0), C, 2))
        if self._dual(modes, y, np.zeros_like(a), spans, regions, free_of_cost=True) > 0:
            return True
        return self._dual(modes, y, a, spans, regions, free_of_cost=False) >= target

    def _dual(
        self,
        modes: Array,
        y: Array,
        a: Array,
        spans: Spans,
        regions: Regions,
        free_of_cost: bool,
    ) -> float:
        """The dual value of a box, less what rounding may have made up."""
        b, last = self.bounds, len(modes) - 1
        value, size = self.motion(modes, a, regions)
        for t in range(len(modes)):
            needed, terms = b.balance(t, y[t])
            value, size = value + needed, size + terms
        pulls = [b.pulls(a[:, c]) for c in range(modes.shape[1])]
        for (steps, c, f), span in zip(intervals(modes), spans, strict=True):
            ends = []
            for rho in span:
                moved = [float(pulls[c][t] @ b.place(t, f, rho)) for t in steps]
                gains = [b.gain(t, f, rho, y[t], free_of_cost) for t in steps if t == last or t + 1 in steps]
                ends.append(sum(moved) - sum(gains))
                size += sum(map(abs, moved)) + sum(map(abs, gains))
            value += min(ends)
        return value - ROUNDING * size

    def motion(self, modes: Array, a: Array, regions: Regions) -> tuple[float, float]:
        """-w sum |a|^2 and what free positions add: least over where they may be.  A finger that never touches costs nothing."""
        b = self.bounds
        value = -b.smooth_weight * float((a**2).sum())
        size = abs(value)
        for c in range(modes.shape[1]):
            if (modes[:, c] == FREE).all():
                continue
            pull = b.pulls(a[:, c])
            for t in np.flatnonzero(modes[:, c] == FREE):
                corners = b.free_corners(int(t), regions.get((int(t), c)))
                if len(corners) == 0:
                    return np.inf, 0.0
                terms = corners @ pull[t]
                value, size = value + float(terms.min()), size + float(np.abs(terms).max())
        return value, size


def intervals(modes: Array) -> list[Interval]:
    """Contacts of a sequence (T, C), finger by finger."""
    found: list[Interval] = []
    for c in range(modes.shape[1]):
        start = 0
        for f, run in itertools.groupby(modes[:, c].tolist()):
            steps = range(start, start := start + len(list(run)))
            if f != FREE:
                found.append((steps, c, int(f)))
    return found


def numbers(packed: Any, shape: tuple[int, ...]) -> Array:
    """Little-endian float64 in base64, all finite and of a size that can be squared."""
    values = np.frombuffer(base64.b64decode(packed, validate=True), dtype="<f8").reshape(shape)
    if not (np.abs(values) <= LARGEST).all():
        raise Unproved("the certificate holds numbers that are not finite, or huge")
    return values


def parts(proof: dict[str, Any], count: int) -> list[dict[str, Any]]:
    """All parts of a split."""
    if len(proof["parts"]) != count:
        raise Unproved("a part of a split is missing")
    return list(proof["parts"])
