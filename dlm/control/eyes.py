"""What the policy knows of Push-T: predicted by the model, corrected by what it sees."""

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from dlm.control import pusht
from dlm.control.look import Stage, find_agent, find_block, follow_block, frame_of, stage
from dlm.control.picture import empty_scene
from expert.errors import InvalidProblem
from expert.geometry.pose import Array
from expert.pushing.drive import Drive
from expert.pushing.goal import Goal
from expert.pushing.impulses import ANGLE, Law, X, run

LOST, LOST_BY = 2.5, 250.0
"""A fit whose squared error exceeds this multiple of the usual one by this much is doubted: look everywhere."""


@dataclass
class Belief:
    """Pose (3,) of the block's centre of gravity; position and velocity (2,) of the agent; whether the block just moved.

    position is None as long as the agent has not been seen.
    """

    pose: Array
    position: Array | None
    velocity: Array
    moving: bool = False


class Eyes(Protocol):
    """Turns observations into beliefs; `act` tells it the command that follows."""

    def reset(self) -> None: ...
    def see(self, observation: object) -> Belief: ...
    def act(self, command: Array) -> None: ...


@dataclass
class StateEyes:
    """Reads the environment's state vector (agent x, y, block x, y, angle); the agent's velocity is reckoned."""

    drive: Drive = field(default_factory=Drive)
    belief: Belief | None = None
    command: Array | None = None

    def reset(self) -> None:
        """Forget the episode."""
        self.belief = self.command = None

    def see(self, observation: object) -> Belief:
        """From (5,) or {"state": (5,)}.  Raises InvalidProblem."""
        state = observation.get("state") if isinstance(observation, dict) else observation
        values = np.asarray(state, dtype=float) if state is not None else np.empty(0)
        if values.shape != (5,) or not np.isfinite(values).all():
            raise InvalidProblem("state", expected="5 numbers", got=f"shape {values.shape}")
        pose, velocity, moving = pusht.about_centre(values[2:]), np.zeros(2), False
        if self.belief is not None and self.command is not None and self.belief.position is not None:
            velocity = self.drive.after(self.belief.position, self.belief.velocity, self.command)[1]
            moving = bool(np.abs(pose - self.belief.pose).max() > 1e-3)
        self.belief = Belief(pose, values[:2], velocity, moving)
        return self.belief

    def act(self, command: Array) -> None:
        """The command of this step."""
        self.command = command


@dataclass
class PixelEyes:
    """Follows block and agent in frames (96, 96, 3).  The agent is seen once, then reckoned: its drive forgets all errors.

    While the block rests, what is seen of it is averaged.
    """

    law: Law
    goal: Goal
    drive: Drive = field(default_factory=Drive)
    belief: Belief | None = None
    commands: list[Array] = field(default_factory=list)
    last: int = 0
    usual: float = 0.0
    seen: list[Array] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.stage: Stage = stage(
            self.law.edges, empty_scene(self.law.edges, self.goal.pose), self.drive.radius
        )

    def reset(self) -> None:
        """Forget the episode."""
        self.belief, self.commands, self.seen, self.usual = None, [], [], 0.0

    def act(self, command: Array) -> None:
        """The command of this step."""
        self.commands.append(command)

    def see(self, observation: object) -> Belief:
        """From a frame or {"pixels": frame}.  Raises InvalidProblem."""
        pixels = observation.get("pixels") if isinstance(observation, dict) else observation
        frame = frame_of(pixels)
        if self.belief is None or self.belief.position is None:
            return self._look(pixels)
        guess, position, velocity, moving = self._predicted(self.belief)
        pose, error = follow_block(self.stage, frame, guess, self.last, position)
        if error > LOST * self.usual + LOST_BY:
            pose, self.last, error = find_block(self.stage, frame, self.goal.centroid, position)
        self.usual = 0.8 * self.usual + 0.2 * error
        self.seen = [pose] if moving else [*self.seen, pose]
        self.belief = Belief(np.mean(self.seen, axis=0), position, velocity, moving)
        return self.belief

    def _look(self, pixels: object) -> Belief:
        """Everything from nothing; an agent that hides is where its commands have drawn it after a while."""
        frame = frame_of(pixels)
        agent = find_agent(self.stage, frame)
        if agent is None and len(self.commands) >= 8:
            agent = self.commands[-1]
        pose, self.last, self.usual = find_block(self.stage, frame, self.goal.centroid, agent)
        self.seen = [pose]
        self.belief = Belief(pose, agent, np.zeros(2))
        return self.belief

    def _predicted(self, before: Belief) -> tuple[Array, Array, Array, bool]:
        """Block, agent and whether the block is touched, after the last command."""
        state = np.zeros(13)
        assert before.position is not None
        state[:2], state[2:4], state[X : ANGLE + 1] = before.position, before.velocity, before.pose
        run(self.law, state, self.commands[-1][None], self.drive.substeps)
        pose = state[X : ANGLE + 1].copy()
        return pose, state[:2].copy(), state[2:4].copy(), bool((pose != before.pose).any())
