"""The pointer: a head chooses the schedule, and the query of each finger attends over the facets of the perceived polygon."""

from math import sqrt
from typing import Any

import torch
from torch import Tensor, nn

from dlm.structured.classes import Schedules
from dlm.structured.scorer import Ranker


class Pointer(Ranker):
    """log p(schedule) + log p(first facet | schedule) + log p(second facet | schedule, first facet), up to what masks take away.

    A facet is pointed at by its token, never by coordinates: what the answer says of geometry is what was perceived.
    """

    def __init__(self, schedules: Schedules, *, width: int = 96, **sizes: Any) -> None:
        super().__init__(schedules, width=width, **sizes)
        self.schedule = nn.Linear(width, len(schedules))
        self.plan = nn.Parameter(0.1 * torch.randn(len(schedules), width))
        self.queries = nn.ModuleList(_query(width) for _ in range(2))
        self.keys = nn.ModuleList(nn.Linear(width, width, bias=False) for _ in range(2))
        self.taken = nn.Linear(width, width)

    def pairs(self, facets: Tensor, whole: Tensor, present: Tensor) -> Tensor:
        asked = whole[:, None] + self.plan  # (b, s, width)
        first = self._attend(0, asked[:, :, None], facets, present)[:, :, 0]
        second = self._attend(1, asked[:, :, None] + self.taken(facets)[:, None], facets, present)
        return self.schedule(whole).log_softmax(-1)[..., None, None] + first[..., None] + second

    def _attend(self, finger: int, asked: Tensor, facets: Tensor, present: Tensor) -> Tensor:
        """Log shares (b, s, n, f) that the finger's queries, asked (b, s, n, width), give to the facets."""
        query, key = self.queries[finger](asked), self.keys[finger](facets)
        scores = torch.einsum("bsnw,bfw->bsnf", query, key) / sqrt(key.shape[-1])
        # Finite, or the logarithm's slope would be nan where nothing is present.
        return scores.masked_fill(~present[:, None, None], -1e9).log_softmax(-1)


def _query(width: int) -> nn.Module:
    return nn.Sequential(nn.Linear(width, width), nn.ReLU(), nn.Linear(width, width))
