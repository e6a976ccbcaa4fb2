"""The scorer: how likely is each contact class the best one?  A transformer over facets and steps, a perceptron over pairs."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from datasets.motions import TaskSettings
from dlm.structured.classes import Schedules
from dlm.structured.features import FACET_NUMBERS, STEP_NUMBERS, Geometry, facet_tokens, step_tokens
from expert.geometry.pose import Array
from expert.world.values import IntArray


def stack(geometries: Sequence[tuple[Array, Array]]) -> Geometry:
    """Batch of (vertices (V, 2), poses (T, 3))."""
    most = max(len(v) for v, _ in geometries)
    padded = np.zeros((len(geometries), most, 2))
    for row, (v, _) in zip(padded, geometries, strict=True):
        row[: len(v)] = v
    return Geometry(
        vertices=torch.from_numpy(padded),
        count=torch.tensor([len(v) for v, _ in geometries]),
        poses=torch.from_numpy(np.stack([q for _, q in geometries])),
    )


class Encoder(nn.Module):
    """Facets (b, f, width) and steps (b, t, width), each aware of all others."""

    def __init__(self, *, steps: int, width: int, layers: int, heads: int) -> None:
        super().__init__()
        self.facet = _embedding(steps * FACET_NUMBERS + 1, width)
        self.step = _embedding(STEP_NUMBERS, width)
        self.clock = nn.Parameter(0.1 * torch.randn(steps, width))
        layer = nn.TransformerEncoderLayer(
            width, heads, 2 * width, dropout=0.0, batch_first=True, norm_first=True
        )
        self.mixer = nn.TransformerEncoder(
            layer, layers, norm=nn.LayerNorm(width), enable_nested_tensor=False
        )

    def forward(self, g: Geometry, tasks: TaskSettings) -> tuple[Tensor, Tensor]:
        facets = self.facet(facet_tokens(g, tasks))
        steps = self.step(step_tokens(g, tasks)) + self.clock
        absent = torch.cat([~g.present, torch.zeros(steps.shape[:2], dtype=torch.bool)], 1)
        mixed = self.mixer(torch.cat([facets, steps], 1), src_key_padding_mask=absent)
        return mixed[:, : facets.shape[1]], mixed[:, facets.shape[1] :]


def _embedding(numbers: int, width: int) -> nn.Module:
    return nn.Sequential(nn.Linear(numbers, width), nn.ReLU(), nn.Linear(width, width))


class Ranker(nn.Module):
    """Logits (b, s, f, f) of all classes (schedule, facet of the first finger, facet of the second); -inf where there is none."""

    def __init__(
        self,
        schedules: Schedules,
        *,
        tasks: TaskSettings | None = None,
        steps: int = 5,
        width: int = 96,
        layers: int = 3,
        heads: int = 4,
    ) -> None:
        super().__init__()
        self.schedules, self.tasks = schedules, tasks or TaskSettings()
        self.encoder = Encoder(steps=steps, width=width, layers=layers, heads=heads)

    def pairs(self, facets: Tensor, whole: Tensor, present: Tensor) -> Tensor:
        """Logits (b, s, f, f) of all pairs, from tokens (b, f, width) of the facets, of which some are present (b, f), and (b, width) of the motion."""
        raise NotImplementedError

    def forward(self, g: Geometry) -> Tensor:
        facets, steps = self.encoder(g, self.tasks)
        logits = self.pairs(facets, steps.mean(1), g.present)
        same = torch.from_numpy(self.schedules.symmetric)[:, None, None]
        logits = torch.where(same, logits + logits.transpose(2, 3), logits)
        return logits.masked_fill(~self._classes(g), -torch.inf)

    def _classes(self, g: Geometry) -> Tensor:
        """Which (b, s, f, f) are classes."""
        size = g.vertices.shape[1]
        table = torch.zeros(len(self.schedules), size, size, dtype=torch.bool)
        table[tuple(torch.from_numpy(self.schedules.classes(size)).T)] = True
        return table & g.present[:, None, :, None] & g.present[:, None, None, :]

    def rank(self, vertices: Array, poses: Array) -> IntArray:
        """All classes of one task, the likeliest first, (k, 3)."""
        with torch.no_grad():
            logits = self(stack([(vertices, poses)]))[0]
        classes = self.schedules.classes(len(vertices))
        scores = logits[tuple(torch.from_numpy(classes).T)].numpy()
        return classes[np.argsort(-scores, kind="stable")]


class Scorer(Ranker):
    """A perceptron over pairs of facets."""

    def __init__(self, schedules: Schedules, *, width: int = 96, **sizes: Any) -> None:
        super().__init__(schedules, width=width, **sizes)
        self.first, self.second, self.whole = (nn.Linear(width, width) for _ in range(3))
        self.pair = nn.Sequential(
            nn.ReLU(), nn.Linear(width, width), nn.ReLU(), nn.Linear(width, len(schedules))
        )

    def pairs(self, facets: Tensor, whole: Tensor, present: Tensor) -> Tensor:
        both = self.first(facets)[:, :, None] + self.second(facets)[:, None]
        return self.pair(both + self.whole(whole)[:, None, None]).permute(0, 3, 1, 2)
