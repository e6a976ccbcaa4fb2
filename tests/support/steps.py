"""The simulator, driven by commands or for one step, without any plan."""

import numpy as np

from dlm.simulator import Replay, Scene, SceneBatch, SimulatorSettings
from dlm.simulator.replay import simulate
from expert.geometry.pose import Array
from tests.support.step_oracle import Step


def driven(
    scene: Scene,
    start: Array,
    commands: Array,
    fingers: Array,
    velocity: Array | None = None,
    **settings: float,
) -> Replay:
    """Motion under commands (S + 1, C, 2), one every substep, fingers first at (C, 2)."""
    batch, chosen = SceneBatch.of([scene]), SimulatorSettings(**settings)
    return simulate(batch, commands, np.asarray(start, float), fingers, chosen, velocity=velocity)


def simulated_step(step: Step) -> tuple[Array, int, int]:
    """Velocity (3,) after one uncut step, whether its contact problem has other solutions, and whether that is unknown."""
    substeps = round(step.scene.trajectory.dt / step.h)
    record = driven(
        step.scene,
        step.pose,
        step.commands,
        step.fingers,
        step.velocity,
        substeps=substeps,
        step_error=np.inf,
    )
    return record.substep_velocities[1], record.several, record.unchecked
