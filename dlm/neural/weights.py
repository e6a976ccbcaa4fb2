"""Shipped weights of `model: neural`, and models with weights of a trained stage, whose proposals are checked.

`python -m dlm.neural.weights runs/neural/seed_0/mdr.safetensors` makes the file of the package.
"""

import sys
from pathlib import Path

from dlm.neural.policies import NeuralArchitecture
from dlm.structured.model import StructuredModel
from dlm.structured.trial import Trial
from dlm.structured.weights import strip, trained_model

SHIPPED = Path(__file__).with_name("weights.safetensors")
COMMAND = "python train.py experiment=neural"


def trained(path: Path) -> StructuredModel:
    """The model with the pointer and the calibration of a checkpoint; plans are tried out before one is picked.

    Raises InvalidProblem for a missing or damaged file, and for weights of another model.
    """
    return trained_model(path, architecture=NeuralArchitecture(), trial=Trial(), command=COMMAND)


def shipped() -> StructuredModel:
    """The model with the weights that come with the package."""
    return trained(SHIPPED)


if __name__ == "__main__":
    strip(Path(sys.argv[1]), SHIPPED)
    print(f"{SHIPPED}: {SHIPPED.stat().st_size} bytes")
