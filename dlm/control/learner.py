"""Learning in the course of an episode what the block is like: where pushes end elsewhere than predicted, the model gives in."""

from dataclasses import dataclass, field, replace

import numpy as np

from dlm.control.eyes import Belief
from expert.geometry.pose import Array, to_world, wrapped
from expert.pushing.identify import LEVER, Seen, identified, misfit
from expert.pushing.planner import Planner
from expert.pushing.room import inside
from expert.pushing.table import again

KEPT_PUSHES = 6
REST = 1.2
"""A block that moves less than this in a step is at rest [length]."""
BETTER = 0.6
"""A new model is taken where it leaves at most this fraction of the last push's misfit."""


@dataclass
class Learner:
    """Keeps the pushes of an episode, and the planner whose model explains them.

    gate: misfit [length] below which a prediction was good.  Pushes at walls say nothing: walls are not in the model.
    """

    first: Planner
    gate: float
    planner: Planner = field(init=False)
    pushes: list[Seen] = field(default_factory=list)
    beliefs: list[Belief] = field(default_factory=list)
    commands: list[Array] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.planner = self.first

    def reset(self) -> None:
        """A new episode, and maybe another block."""
        self.planner, self.pushes, self.beliefs, self.commands = self.first, [], [], []

    def note(self, belief: Belief, command: Array) -> None:
        """What was believed and commanded in this step."""
        if belief.position is not None:
            self.beliefs.append(belief)
            self.commands.append(command)

    def is_at_rest(self, belief: Belief) -> bool:
        """Whether the block stays where it is, as far as the last step shows."""
        if not self.beliefs:
            return True
        change = belief.pose - self.beliefs[-1].pose
        return bool(np.hypot(*change[:2]) + LEVER * abs(wrapped(change[2])) < REST)

    def learn(self, belief: Belief) -> bool:
        """Look at the push that ends with this belief; whether the planner is a new one."""
        if not self.beliefs:
            return False
        start = self.beliefs[0]
        assert start.position is not None
        poses = np.array([b.pose for b in [*self.beliefs[1:], belief]])
        push = Seen(start.pose, start.position, start.velocity, np.array(self.commands), poses)
        changed = self._is_free(push) and misfit(self.planner.model, push) > self.gate and self._adapt(push)
        if self.is_at_rest(belief):
            if self._is_free(push):
                self.pushes = [*self.pushes, push][-KEPT_PUSHES:]
            self.beliefs, self.commands = [], []
        return changed

    def _adapt(self, push: Seen) -> bool:
        """Take the model that explains this push and those before, if it explains this one much better."""
        model = self.planner.model
        found = identified(model, [*self.pushes, push], self.first.model.block)
        if misfit(found, push) > BETTER * misfit(model, push):
            return False
        table = again(found, self.first.table)
        self.planner = replace(self.first, table=table, model=found)
        return True

    def _is_free(self, push: Seen) -> bool:
        """Whether the block kept off the walls."""
        room = self.first.task.room
        return all(
            inside(room.walls, x, y, 0.0)
            for pose in [push.pose, *push.poses]
            for x, y in to_world(pose, room.hull)
        )
