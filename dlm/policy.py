"""What training and evaluation know of a model: its policies, from video to the fingers' action, and its losses."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Literal, Protocol

import torch
from torch import Tensor, nn

from dlm.inverse_dynamics.layer import Action, InverseDynamics
from dlm.inverse_dynamics.parameters import ParameterBatch
from dlm.tasks import TaskBatch

PolicyKind = Literal["perceptron", "program", "regressor", "best_guess", "proposals"]
"""The first two belong to `model: thesis`, the last three to `model: structured`, all but perceptron and best_guess to `model: neural`."""


class Policy(nn.Module):
    """From videos (b, t, h, w, 3), uint8, to actions."""

    def fit_centre(self, tasks: TaskBatch) -> None:
        """Let the untrained policy answer with the average task of a training set, where it learns deviations from it."""

    def derender(self, video: Tensor) -> ParameterBatch | None:
        """Mechanical parameters of every video, as the program is given them; None where a policy has none."""
        return None

    def weights(self) -> dict[str, Tensor]:
        """What was learned, and what it was scaled by; the constants of a program are neither."""
        return {name: value for name, value in self.state_dict().items() if not name.startswith("program.")}

    def __call__(self, video: Tensor) -> Action:
        return super().__call__(video)


Loss = Callable[[Policy, TaskBatch], Tensor]


class Architecture(Protocol):
    """What a configuration's `model` is: its name, and how to build its policies with weights drawn from a seed."""

    @property
    def name(self) -> str: ...

    def build(self, kind: PolicyKind, program: InverseDynamics, *, seed: int) -> Policy: ...


@contextmanager
def seeded(seed: int) -> Iterator[None]:
    """Weights, dropout and shuffling follow the seed; the caller's random state stays as it was."""
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        yield
