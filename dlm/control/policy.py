"""A policy for anybody's loop: reset, then select_action for each observation.  It never sees the environment."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from dlm.control import pusht
from dlm.control.eyes import HIDDEN, Belief, Eyes, PixelEyes, StateEyes
from dlm.control.learner import Learner
from expert.geometry.pose import Array
from expert.pushing.planner import Planner
from expert.world.values import require

NEAR = 2.5
"""Plans that ended within this multiple of the tolerance, yet not at the goal, make it stricter."""


@dataclass
class PushPolicy:
    """Perceives, plans a push, carries it out, perceives again.

    `arrived` after select_action: the object is at the goal by its own judgement.  Called again nevertheless, it takes
    the goal to be missed, and becomes stricter.
    """

    learner: Learner
    eyes: Eyes
    tolerance: float
    belief: Belief | None = None
    arrived: bool = False
    _queue: list[Array] = field(default_factory=list)
    _strictness: float = 1.0
    _weight: float = 1.0
    _error: float = np.inf

    @classmethod
    def for_pusht(cls, observation: str = "pixels") -> "PushPolicy":
        """For gym-pusht with observations of the type `pixels` or `state`, rehearsed.  Raises InvalidProblem."""
        require(observation in ("pixels", "state"), "observation", "pixels or state", observation)
        settings = pusht.PIXELS if observation == "pixels" else pusht.STATE
        planner = pusht.pusht_planner(settings.speed, settings.wobble)
        planner.rehearse()
        eyes: Eyes = StateEyes()
        if observation == "pixels":
            eyes = PixelEyes(planner.model, planner.goal)
        eyes.rehearse()
        return cls(Learner(planner, settings.gate), eyes, settings.tolerance)

    @property
    def planner(self) -> Planner:
        """With the model of the block as far as it is known."""
        return self.learner.planner

    def reset(self) -> None:
        """Begin a new episode."""
        self.learner.reset()
        self.eyes.reset(self.planner.model)
        self.belief, self.arrived, self._queue = None, False, []
        self._strictness, self._weight, self._error = 1.0, 1.0, np.inf

    def select_action(self, observation: object) -> NDArray[np.float32]:
        """The command (2,) for this step: where the agent shall go.  Raises InvalidProblem for bad observations."""
        self.belief = belief = self.eyes.see(observation)
        if not self._queue:
            self._queue = self._aside(belief) if belief.position is None else self._learned(belief)
        self.arrived = not belief.moving and self._is_arrived(belief)
        command = np.clip(self._queue.pop(0), 0, pusht.SIDE).astype(np.float32)
        self.eyes.act(command.astype(float))
        self.learner.note(belief, command.astype(float))
        return command

    def _is_arrived(self, belief: Belief) -> bool:
        return bool(self.planner.goal.error(belief.pose) < self.tolerance)

    def _learned(self, belief: Belief) -> list[Array]:
        """Learn from the last push; wait while the block slides on; then the next one."""
        resting = self.learner.is_at_rest(belief)
        if self.learner.learn(belief):
            self.eyes.believe(self.planner.model)
        return self._next_push(belief) if resting else [self.learner.commands[-1]]

    def _next_push(self, belief: Belief) -> list[Array]:
        """Commands up to the end of the next push."""
        assert belief.position is not None
        error = float(self.planner.goal.error(belief.pose))
        if error < NEAR * self.tolerance:
            self._strictness = max(0.75 * self._strictness, 0.3)
        self._weight = 1.3 * self._weight if error > 0.95 * self._error else 1.0
        self._error = error
        plan = self.planner.plan(
            belief.pose, belief.position, belief.velocity, self._strictness * self.tolerance, self._weight
        )
        return self._aside(belief) if plan is None else list(plan.commands)

    def _aside(self, belief: Belief) -> list[Array]:
        """The agent hides under the block, or finds no push from where it is: into the corner farthest from the block."""
        corners = np.array([[20.0, 20], [20, 492], [492, 20], [492, 492]])
        away = corners[((corners - belief.pose[:2]) ** 2).sum(1).argmax()]
        return [away] * HIDDEN
