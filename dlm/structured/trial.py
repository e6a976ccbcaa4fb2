"""Trying plans out before one is handed out: simulated on what was perceived, as it is and a little different.

A plan that satisfies every constraint can still fail in execution: a contact hands over between two steps, a corner rolls.
The simulator sees that, in a tenth of a millisecond.
"""

from dataclasses import dataclass, field, replace

import numpy as np
import torch

from dlm.metrics import object_trajectory_loss
from dlm.simulator import Scene, SceneBatch, SimulatorSettings
from dlm.simulator.gradient import rollout
from dlm.structured.calibration import inset
from expert.geometry.pose import Array
from expert.problems.contact import ContactTask, Plan
from expert.world.values import require


@dataclass(frozen=True, kw_only=True)
class Trial:
    """What a plan must survive on the perceived task.

    good: largest risk of a plan that is taken at once [cm^2].  friction: shares of the assumed one.
    inset [m]: the outline moved in and out by as much.  shift [m]: the object starts that far to either side.
    candidates: contact classes whose plans are tried at most, the cheapest first.
    """

    simulator: SimulatorSettings = field(default_factory=SimulatorSettings)
    good: float = 1e-3
    friction: tuple[float, ...] = (0.9,)
    inset: float = 5e-5
    shift: float = 2e-4
    candidates: int = 8

    def __post_init__(self) -> None:
        require(0 < self.good < np.inf, "trial.good", "a positive loss", self.good)
        require(self.candidates >= 1, "trial.candidates", "at least 1", self.candidates)

    def risk(self, task: ContactTask, plan: Plan) -> float:
        """Object-trajectory loss of the trials [cm^2]: half that of the task as it is, half the worst of the others; inf where
        the simulation breaks down."""
        scenes, start = self._variants(task)
        batch = SceneBatch.of(scenes)
        positions, forces = (
            torch.from_numpy(np.repeat(x[None], len(scenes), 0)) for x in (plan.positions, plan.forces)
        )
        poses = rollout(batch, positions, forces, self.simulator, start=start).numpy()
        first, *others = object_trajectory_loss(poses, task.trajectory.poses[None])
        risk = 0.5 * (first + np.max(others))
        return float(risk) if np.isfinite(risk) else np.inf

    def _variants(self, task: ContactTask) -> tuple[list[Scene], Array]:
        """Scenes, and where the object starts in them."""
        true = Scene.of(task)
        scenes = [true, *(replace(true, friction=share * true.friction) for share in self.friction)]
        for distance in (self.inset, -self.inset):
            body = replace(task.body, vertices=inset(task.body.vertices, distance))
            scenes.append(replace(true, body=body))
        start = np.repeat(task.trajectory.poses[:1], len(scenes) + 2, 0)
        start[-2:, 0] += [self.shift, -self.shift]
        return [*scenes, true, true], start
