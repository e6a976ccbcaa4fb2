"""A polygon and its motion, from a video."""

from dlm.perception.perceive import perceive
from dlm.perception.types import Perceived, PerceptionSettings

__all__ = ["Perceived", "PerceptionSettings", "perceive"]
