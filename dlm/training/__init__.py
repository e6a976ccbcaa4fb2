"""Training in stages (Thesis 4.3)."""

from dlm.training.stage import Schedule, Stage

__all__ = ["Schedule", "Stage"]
