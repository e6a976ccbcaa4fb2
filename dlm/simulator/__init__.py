"""Batched, differentiable planar contact simulator (Thesis 4-CT8..4-CT10)."""

from dlm.simulator.gradient import rollout, rollout_with_status
from dlm.simulator.replay import Replay, replay
from dlm.simulator.scene import Scene, SceneBatch
from dlm.simulator.settings import Execution, SimulatorSettings

__all__ = [
    "Execution",
    "Replay",
    "Scene",
    "SceneBatch",
    "SimulatorSettings",
    "replay",
    "rollout",
    "rollout_with_status",
]
