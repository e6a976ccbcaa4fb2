"""Shipped weights: a checkpoint without what only training needs.

`python -m dlm.structured.weights runs/large/seed_0/cvx.safetensors` makes the file of the package from a trained stage.
"""

import sys
from dataclasses import replace
from pathlib import Path

import torch

from dlm.structured.model import StructuredModel
from dlm.structured.policies import StructuredArchitecture
from dlm.structured.trial import Trial
from dlm.training.checkpoint import load, restore_weights

SHIPPED = Path(__file__).with_name("weights.safetensors")
COMMAND = "python train.py experiment=large"


def trained_model(
    path: Path,
    *,
    architecture: StructuredArchitecture | None = None,
    best_guess: bool = False,
    trial: Trial | None = None,
    command: str = COMMAND,
) -> StructuredModel:
    """The model with the network and the calibration of a checkpoint of a stage with proposals.

    architecture: as it was trained, by default `model: structured`.  best_guess: check the likeliest class alone.
    trial: what plans must survive.  command: what makes such files.  Raises InvalidProblem for a missing or damaged file, and
    for weights of another model.
    """
    architecture = architecture or StructuredArchitecture()
    policy = architecture.proposer("best_guess" if best_guess else "proposals")
    restore_weights(policy.weights(), load(path, command=command), name=architecture.name, source=path)
    policy.eval()
    model = policy.model
    return replace(model, planner=replace(policy.planner, trial=trial))


def shipped(*, best_guess: bool = False, robust: bool = True) -> StructuredModel:
    """The model with the weights that come with the package; robust: plans are tried out before one is picked."""
    return trained_model(SHIPPED, best_guess=best_guess, trial=Trial() if robust else None)


def strip(source: Path, target: Path) -> None:
    """Copy a checkpoint without the moments of its optimiser and the state of its random generator."""
    saved = load(source, command=COMMAND)
    replace(saved, optimiser={}, random=torch.zeros(0, dtype=torch.uint8)).save(target)


if __name__ == "__main__":
    strip(Path(sys.argv[1]), SHIPPED)
    print(f"{SHIPPED}: {SHIPPED.stat().st_size} bytes")
