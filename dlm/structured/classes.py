"""Contact classes: which fingers touch when (a schedule) and which facet each of them touches.

Contact is discontinuous: a network should choose among classes rather than regress coordinates.  A finger keeps to one facet
in a class; plans in which one changes facets belong to no class (none of 10,000 labels).
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from expert.problems.contact import FREE
from expert.world.values import IntArray, require

Mask = np.ndarray[tuple[int, ...], np.dtype[np.bool_]]

TOUCHING, WAITING = "x", "."
MEASURED = (
    "xxxxx xxxxx",
    "..xxx xxxxx",
    ".xxxx xx...",
    "...xx xxxxx",
    ".xxxx xxxxx",
    "..... xxxxx",
    "xx... xxxxx",
    "...xx xxxx.",
)
"""Schedules of five steps and two fingers by falling share of the expert's labels; docs/theory/structured.md has the shares."""


@dataclass(frozen=True)
class Schedules:
    """Vocabulary of schedules, one text each: a word per finger, a letter per step, x where the finger touches.

    Fingers are interchangeable: the words of a schedule are in alphabetical order, and so are facets of equal words.
    A class is a row (schedule, facet of the first finger, facet of the second); a finger that never touches repeats the
    other's facet.
    """

    patterns: tuple[str, ...] = MEASURED

    def __post_init__(self) -> None:
        object.__setattr__(self, "patterns", tuple(" ".join(sorted(p.split())) for p in self.patterns))
        require(len(self.patterns) > 0, "schedules", "at least one", 0)
        steps = {len(word) for p in self.patterns for word in p.split()}
        words = {len(p.split()) for p in self.patterns}
        letters = set("".join(self.patterns)) <= {TOUCHING, WAITING, " "}
        fits = letters and len(steps) == 1 and words == {2}
        require(fits, "schedules", "two words of equal length made of x and .", list(self.patterns))
        require(len(set(self.patterns)) == len(self.patterns), "schedules", "no repetitions", self.patterns)

    def __len__(self) -> int:
        return len(self.patterns)

    @cached_property
    def touching(self) -> Mask:
        """Contact flags (schedule, step, finger)."""
        words = [p.split() for p in self.patterns]
        return np.array([[[letter == TOUCHING for letter in word] for word in p] for p in words]).swapaxes(
            1, 2
        )

    @cached_property
    def symmetric(self) -> Mask:
        """(schedule,): both fingers do the same."""
        return (self.touching[..., 0] == self.touching[..., 1]).all(axis=1)

    @cached_property
    def single(self) -> Mask:
        """(schedule,): only one finger ever touches."""
        first, second = np.moveaxis(np.array(self.touching.any(axis=1)), 1, 0)
        return first != second

    def classes(self, facets: int) -> IntArray:
        """All classes of an object with so many facets, (k, 3)."""
        s, a, b = (
            x.ravel() for x in np.meshgrid(*map(np.arange, (len(self), facets, facets)), indexing="ij")
        )
        valid = np.where(self.single[s], a == b, ~self.symmetric[s] | (a <= b))
        return np.column_stack([s, a, b])[valid]

    def modes(self, classes: IntArray) -> IntArray:
        """Modes (k, T, C) of classes (k, 3), as in `expert.types.Plan`."""
        return np.ascontiguousarray(np.where(self.touching[classes[:, 0]], classes[:, None, 1:], FREE))

    def class_of(self, modes: IntArray) -> tuple[int, int, int] | None:
        """The class of a plan's modes (T, 2); None where the vocabulary has none."""
        columns = sorted(modes.T.tolist(), key=lambda column: (_word(column), column))
        pattern = " ".join(map(_word, columns))
        facets = [sorted({mode for mode in column if mode != FREE}) for column in columns]
        if pattern not in self.patterns or max(map(len, facets)) > 1:
            return None
        touched = [f[0] if f else facets[1 - c][0] for c, f in enumerate(facets)]
        return self.patterns.index(pattern), touched[0], touched[1]


def _word(column: Sequence[int]) -> str:
    return "".join(WAITING if mode == FREE else TOUCHING for mode in column)


def shares(labels: Iterable[IntArray]) -> dict[str, float]:
    """Share of each schedule among plans' modes (T, 2), most frequent first; a change of facets counts by itself."""
    counts: dict[str, int] = {}
    total = 0
    for modes in labels:
        words = sorted(_word(column) for column in modes.T.tolist())
        changing = any(len(set(column) - {FREE}) > 1 for column in modes.T.tolist())
        name = "a finger changes facets" if changing else " ".join(words)
        counts[name] = counts.get(name, 0) + 1
        total += 1
    return {name: n / total for name, n in sorted(counts.items(), key=lambda item: -item[1])}
