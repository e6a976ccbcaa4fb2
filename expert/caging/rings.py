"""Orders of fingers along the loop, ways to fill it at its ends, and the symmetries of both."""

import itertools
from collections.abc import Iterator

import numpy as np

from expert.caging.model import SweptModel
from expert.loops.model import Element
from expert.problems.cage import CageProblem
from expert.world.frame import Frame


def rings(problem: CageProblem, frame: Frame) -> Iterator[list[Element]]:
    """Orders in which the loop may visit the searched fingers, and with them the fixed fingers or one wall."""
    fixed = frame.relative(problem.fixed)
    around = [Element(ends=np.stack([p, p])) for p in fixed[np.argsort(np.arctan2(*fixed.T[::-1]))]]
    for order in _orders(problem):
        free = [Element(finger=k) for k in order]
        for a, b in frame.relative(problem.wall_ends):
            ends = np.stack([a, b])
            yield [*free, *around, Element(ends=ends, joined=True), Element(ends=ends)]
        if len(free) + len(around) >= 2:
            yield [*free, *around]


def labelled(problem: CageProblem) -> bool:
    """Whether searched fingers differ from one another."""
    return bool(problem.grippers) or problem.cost == "max_opening"


def _orders(problem: CageProblem) -> Iterator[tuple[int, ...]]:
    """Cyclic orders of the searched fingers: one, unless grippers or a cost tell them apart."""
    if not labelled(problem):
        yield tuple(range(problem.count))
        return
    if problem.parallel and problem.count == 4 and len(problem.grippers) == 2:
        (a, b), (c, d) = (gripper.fingers for gripper in problem.grippers)
        yield (a, b, d, c)  # the first gripper below the second, counter-clockwise
        yield (c, d, b, a)
        return
    for rest in itertools.permutations(range(1, problem.count)):
        yield (0, *rest)


def hubs(count: int, alike: bool) -> list[tuple[int, int]]:
    """Ways to fill the loop at L and U.  Where elements are alike, renaming lets the fan at U start at element 0."""
    if count == 3:
        return [(0, 0)]
    ways = range(2 if count in (2, 4) else count)  # on a square, opposite corners span the same diagonal
    pairs = [(a, b) for a in ways for b in ways if not alike or count == 2 or b == 0]
    return sorted(pairs, key=lambda p: p[0] == p[1])


def break_symmetry(model: SweptModel, problem: CageProblem) -> None:
    """Renaming fingers that are alike changes nothing: one of them is the leftmost."""
    if len(model.ring) > problem.count or labelled(problem):
        return
    if problem.count == 3:
        model.leftmost_first([1, 2])
    elif problem.count == 4 or problem.count == 2:
        model.leftmost_first([problem.count // 2])
