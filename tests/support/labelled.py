"""Random tasks with the real expert's plans."""

from functools import cache

import numpy as np

from datasets.label import Label, Labelling, label
from datasets.motions import FAMILIES, NoRoom, sample_task
from datasets.shapes import Shapes


@cache
def labels(count: int, facets: tuple[int, int], seed: int = 0) -> tuple[Label, ...]:
    """`count` labelled tasks, the six families in turn; tasks without a plan are drawn again."""
    found: list[Label] = []
    rng = np.random.default_rng(seed)
    while len(found) < count:
        family = list(FAMILIES)[len(found) % 6]
        try:
            answer = label(sample_task(rng, family, Shapes(facets=facets)), Labelling(node_limit=300))
        except NoRoom:
            continue
        if isinstance(answer, Label):
            found.append(answer)
    return tuple(found)
