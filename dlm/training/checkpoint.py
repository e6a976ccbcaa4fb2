"""Checkpoints: one safetensors file per stage, replaced as a whole, whose header says what made it.

Tensors `model.<name>`, `optimiser.<name>` and `random`; JSON text under `about` in the header.
A file holds all that training needs to go on as if it had never stopped.
"""

import json
import platform
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from importlib.metadata import version
from pathlib import Path

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save as to_bytes
from torch import Tensor

from expert.errors import InvalidProblem
from expert.files.output import Output, folder

SCHEMA = 1
PACKAGES = ("certified-manipulation", "torch", "numpy", "cvxpy", "cvxpylayers", "diffcp", "clarabel", "numba")

OWN = ("dlm.", "datasets.")
"""Packages whose classes a checkpoint may name."""


def versions() -> dict[str, str]:
    """Versions of Python and of the packages that decide the numbers."""
    return {"python": platform.python_version(), **{name: version(name) for name in PACKAGES}}


@dataclass(frozen=True, kw_only=True)
class About:
    """What made a checkpoint.

    model: architecture, by name.  settings: all training settings as plain values.  data: fingerprint of the training data.
    history: one row of named losses per logged iteration.  seconds: processor time so far.
    """

    stage: str
    model: str
    iteration: int
    settings: dict[str, object]
    data: str
    history: list[dict[str, float]]
    seconds: float = 0.0
    versions: dict[str, str] = field(default_factory=versions)
    schema: int = SCHEMA


@dataclass(frozen=True, kw_only=True)
class Checkpoint:
    """State of one training stage: weights, optimiser moments, state of the random generator."""

    about: About
    model: dict[str, Tensor]
    optimiser: dict[str, Tensor]
    random: Tensor

    def save(self, path: Path) -> None:
        """Write the file whole or not at all; raises InvalidProblem where that fails, and says where it is kept instead."""
        tensors = {f"model.{k}": v for k, v in self.model.items()}
        tensors |= {f"optimiser.{k}": v for k, v in self.optimiser.items()}
        tensors["random"] = self.random
        contiguous = {k: v.detach().cpu().contiguous() for k, v in tensors.items()}
        content = to_bytes(contiguous, metadata={"about": json.dumps(asdict(self.about))})
        with folder(path.parent), Output(path) as output:
            output.deliver(content)


def load(path: Path, *, command: str) -> Checkpoint:
    """Read a checkpoint.  Raises InvalidProblem with the command that makes it where it is missing or damaged."""
    about = read_about(path, command=command)
    with safe_open(path, framework="pt") as file:
        tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 (not a mapping)
    return Checkpoint(
        about=about,
        model=_part(tensors, "model."),
        optimiser=_part(tensors, "optimiser."),
        random=tensors["random"],
    )


def read_about(path: Path, *, command: str) -> About:
    """Only the header of a checkpoint.  Raises InvalidProblem as `load` does."""
    if not path.is_file():
        raise InvalidProblem(
            "checkpoint", expected=f"the file {path}", got="no such file", remedy=f"make it with: {command}"
        )
    try:
        # As numpy: torch opens the path a second time, when another checkpoint may have taken its place.
        with safe_open(path, framework="np") as file:
            about = json.loads((file.metadata() or {})["about"])
        if about.get("schema") != SCHEMA:
            raise InvalidProblem(
                f"checkpoint {path}",
                expected=f"schema {SCHEMA}",
                got=f"schema {about.get('schema')}",
                remedy=f"make it again with: {command}",
            )
        _require_own_classes(about["settings"], path)
        return About(**about)
    except (SafetensorError, KeyError, TypeError, ValueError, AttributeError) as error:
        raise InvalidProblem(
            f"checkpoint {path}",
            expected="a whole checkpoint file",
            got=f"{type(error).__name__}: {error}".splitlines()[0],
            remedy=f"make it again with: {command}",
        ) from error


def _require_own_classes(settings: object, path: Path) -> None:
    """Settings may name classes to build: only those of our packages, or a file from elsewhere could run anything."""
    if isinstance(settings, Mapping):
        target = settings.get("_target_", "dlm.")
        if not str(target).startswith(OWN):
            raise InvalidProblem(f"checkpoint {path}", expected="classes of dlm", got=f"{target}"[:60])
        for value in settings.values():
            _require_own_classes(value, path)
    elif isinstance(settings, list):
        for value in settings:
            _require_own_classes(value, path)


def _part(tensors: Mapping[str, Tensor], prefix: str) -> dict[str, Tensor]:
    return {name.removeprefix(prefix): value for name, value in tensors.items() if name.startswith(prefix)}


def optimiser_tensors(optimiser: torch.optim.Optimizer) -> dict[str, Tensor]:
    """State of an optimiser as named tensors `<parameter>.<quantity>`; step sizes and the like belong to the settings."""
    state = optimiser.state_dict()["state"]
    return {f"{index}.{name}": value for index, row in state.items() for name, value in row.items()}


def restore_optimiser(optimiser: torch.optim.Optimizer, tensors: Mapping[str, Tensor]) -> None:
    """Inverse of `optimiser_tensors`."""
    state: dict[int, dict[str, Tensor]] = {}
    for key, value in tensors.items():
        index, name = key.split(".", 1)
        state.setdefault(int(index), {})[name] = value
    optimiser.load_state_dict({"state": state, "param_groups": optimiser.state_dict()["param_groups"]})


def restore_weights(
    weights: Mapping[str, Tensor], checkpoint: Checkpoint, *, name: str, source: Path
) -> None:
    """Overwrite the weights of a model called `name`.  Raises InvalidProblem for the checkpoint of another model."""
    if checkpoint.about.model != name:
        raise InvalidProblem(
            f"checkpoint {source}",
            expected=f"weights of model {name}",
            got=f"weights of model {checkpoint.about.model}",
            remedy="choose the model that was trained, or another output folder",
        )
    for key in sorted({*weights, *checkpoint.model}):
        wanted, found = (tuple(w[key].shape) if key in w else None for w in (weights, checkpoint.model))
        if wanted != found:
            raise InvalidProblem(
                f"checkpoint {source}",
                expected=f"{key} of shape {wanted}",
                got=f"shape {found}",
                remedy="it was trained with other settings; train again",
            )
    with torch.no_grad():
        for key, value in weights.items():
            value.copy_(checkpoint.model[key])
