"""Batched, differentiable planar contact simulator (Thesis 4.2).  Its torch function is `dlm.simulator.gradient.rollout`."""

from dlm.simulator.replay import Replay, replay
from dlm.simulator.scene import Scene, SceneBatch
from dlm.simulator.settings import Execution, SimulatorSettings

__all__ = ["Execution", "Replay", "Scene", "SceneBatch", "SimulatorSettings", "replay"]
