"""`model: neural`: perceived polygon and poses, a pointer to facets and a schedule, parameters assembled from both, the program."""

from dlm.neural.policies import NeuralArchitecture, PointerPolicy

__all__ = ["NeuralArchitecture", "PointerPolicy"]
