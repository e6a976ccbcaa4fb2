"""Batched mechanical parameters P(t) as torch tensors, and the one flattening that networks, losses and stores use."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import prod

import torch
from torch import Tensor

from datasets.parameters import (
    EXTERNAL_CONTACTS,
    REGION_ROWS,
    SCHEMA,
    MechanicalParameters,
    Parameters,
    field_shapes,
)
from expert.world.values import require

FLAGS = tuple(name for name, quantity in SCHEMA.items() if quantity.flag)


@dataclass(frozen=True, kw_only=True)
class ParameterBatch(Parameters[Tensor]):
    """P(t) of a batch of tasks, (b, t, ...).  The FLAGS may take any value from 0 to 1."""

    def __post_init__(self) -> None:
        batch = self.contact.shape[:2]
        fingers, rows = self.region_offsets.shape[2:]
        shapes = field_shapes(fingers, rows, self.external_points.shape[2])
        for name, value in self.named().items():
            wanted = (*batch, *shapes[name])
            require(tuple(value.shape) == wanted, name, f"shape {wanted}", tuple(value.shape))

    @classmethod
    def stack(
        cls, tasks: Sequence[MechanicalParameters], dtype: torch.dtype = torch.float64
    ) -> "ParameterBatch":
        """Batch of single tasks with the same numbers of steps, fingers, rows and external contacts."""
        require(len(tasks) > 0, "tasks", "at least one task", len(tasks))
        columns = {n: [p.named()[n] for p in tasks] for n in SCHEMA}
        return cls(**{n: torch.stack([torch.tensor(a, dtype=dtype) for a in v]) for n, v in columns.items()})

    def map(self, function: Callable[[Tensor], Tensor]) -> "ParameterBatch":
        """The same function on every field, for instance `.map(Tensor.detach)` or `.map(lambda x: x[mask])`."""
        return replace(self, **{name: function(value) for name, value in self.named().items()})


@dataclass(frozen=True, kw_only=True)
class Layout:
    """Order, shapes and physical scales of the numbers at one step: a network's output row.

    Typical values of every field are 1 after division by its scale, made of length [m] and force [N].
    """

    fingers: int = 2
    rows: int = REGION_ROWS
    external: int = EXTERNAL_CONTACTS
    length: float = 0.1
    force: float = 1.0

    @cached_property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shape of each field at one step."""
        return field_shapes(self.fingers, self.rows, self.external)

    @property
    def width(self) -> int:
        """Numbers per step."""
        return sum(prod(s) for s in self.shapes.values())

    @cached_property
    def scales(self) -> dict[str, Tensor]:
        """Physical scale of each field, broadcastable to its shape."""
        units = {"m": self.length, "N": self.force, "N m": 0.1 * self.force * self.length}
        scale = {name: [units.get(u, 1.0) for u in q.unit.split(", ")] for name, q in SCHEMA.items()}
        return {name: torch.tensor(numbers, dtype=torch.float64) for name, numbers in scale.items()}

    def flatten(self, parameters: ParameterBatch) -> Tensor:
        """(b, t, width), every number divided by its scale."""
        columns = [self._scaled(n, v, down=True).flatten(2) for n, v in parameters.named().items()]
        return torch.cat(columns, dim=-1)

    def unflatten(self, flat: Tensor) -> ParameterBatch:
        """Inverse of `flatten`; differentiable; keeps the dtype.  Flags are taken as they are (see `squash`)."""
        parts = self.split(flat)
        return ParameterBatch(**{n: self._scaled(n, parts[n], down=False) for n in self.shapes})

    def split(self, flat: Tensor) -> dict[str, Tensor]:
        """Views of the columns of each field, (b, t, ...), still divided by their scales."""
        require(flat.shape[-1] == self.width, "flat", f"{self.width} numbers per step", flat.shape[-1])
        sizes = [prod(s) for s in self.shapes.values()]
        pieces = torch.split(flat, sizes, dim=-1)
        return {
            n: x.reshape(*flat.shape[:-1], *s) for (n, s), x in zip(self.shapes.items(), pieces, strict=True)
        }

    def squash(self, logits: Tensor) -> Tensor:
        """Network output to a valid row: flags through a sigmoid, everything else unchanged.  Same shape as the input."""
        parts = self.split(logits)
        return torch.cat([(x.sigmoid() if n in FLAGS else x).flatten(2) for n, x in parts.items()], dim=-1)

    def relevance(self, target: ParameterBatch) -> Tensor:
        """Weights (b, t, width), 1 where a number of the target means something and 0 where it is a filler."""
        columns = [_meaningful(target, n).expand_as(v).flatten(2) for n, v in target.named().items()]
        return torch.cat(columns, dim=-1)

    def _scaled(self, name: str, value: Tensor, *, down: bool) -> Tensor:
        scale = self.scales[name].to(value)
        return value / scale if down else value * scale


def _meaningful(target: ParameterBatch, name: str) -> Tensor:
    """1 where a field of the target means something, 0 where it is a filler; broadcastable to the field."""
    value, where = target.named()[name], SCHEMA[name].where
    if not where:
        return torch.ones_like(value)
    given = target.named()[where]
    mark = given if SCHEMA[where].flag else (given != 0).any(-1)
    return mark.to(value.dtype).view(*mark.shape, *[1] * (value.dim() - mark.dim()))
