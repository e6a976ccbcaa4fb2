"""What the policy knows of Push-T: predicted by the model, corrected by what it sees."""

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from dlm.control import pusht
from dlm.control.look import Frame, Stage, find_agent, find_block, follow_block, frame_of, stage
from dlm.control.picture import empty_scene, painted
from expert.errors import InvalidProblem
from expert.geometry.pose import Array
from expert.pushing.drive import Drive
from expert.pushing.goal import Goal
from expert.pushing.impulse_model import ImpulseModel
from expert.pushing.impulses import ANGLE, X, run

LOST, LOST_BY = 2.5, 250.0
"""A fit whose squared error exceeds this multiple of the usual one by this much is doubted: look everywhere."""


HIDDEN = 8
"""Steps after which an agent that nobody saw is where it is told to be."""


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
    """Turns observations into beliefs; `act` tells it the command that follows, `believe` what the block is like."""

    def rehearse(self) -> None: ...
    def reset(self, model: ImpulseModel) -> None: ...
    def believe(self, model: ImpulseModel) -> None: ...
    def see(self, observation: object) -> Belief: ...
    def act(self, command: Array) -> None: ...


@dataclass
class StateEyes:
    """Reads the environment's state vector (agent x, y, block x, y, angle); the agent's velocity is reckoned."""

    drive: Drive = field(default_factory=Drive)
    belief: Belief | None = None
    command: Array | None = None

    def rehearse(self) -> None:
        """There is nothing to load."""

    def reset(self, model: ImpulseModel) -> None:
        """Forget the episode."""
        self.belief = self.command = None

    def believe(self, model: ImpulseModel) -> None:
        """What is read is believed, whatever the model."""

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

    model: ImpulseModel
    goal: Goal
    belief: Belief | None = None
    commands: list[Array] = field(default_factory=list)
    last: int = 0
    usual: float = 0.0
    seen: list[Array] = field(default_factory=list)
    state: Array = field(default_factory=lambda: np.zeros(13))

    def __post_init__(self) -> None:
        edges = self.model.edges
        self.stage: Stage = stage(edges, empty_scene(edges, self.goal.pose), self.model.radius)

    def reset(self, model: ImpulseModel) -> None:
        """Forget the episode."""
        self.model = model
        self.belief, self.commands, self.seen, self.usual = None, [], [], 0.0

    def rehearse(self) -> None:
        """Load compiled code with pictures of one's own, so that the first look takes no longer than others."""
        pose, agent = self.goal.pose, np.array([60.0, 60.0])
        picture = painted(self.model.edges, self.stage.empty, pose, self.model.radius, agent)
        self.reset(self.model)
        for _ in range(2):
            self.see(picture)
            self.act(agent)
        self.reset(self.model)

    def believe(self, model: ImpulseModel) -> None:
        """Predict with another model from now on."""
        self.model = model

    def act(self, command: Array) -> None:
        """The command of this step."""
        self.commands.append(command)

    def see(self, observation: object) -> Belief:
        """From a frame or {"pixels": frame}.  Raises InvalidProblem."""
        pixels = observation.get("pixels") if isinstance(observation, dict) else observation
        frame = frame_of(pixels)
        if self.belief is None or self.belief.position is None:
            return self._look(frame)
        moving = self._predict(self.belief.pose)
        guess, position = self.model.frame_pose(self.state[X : ANGLE + 1]), self.state[:2].copy()
        pose, error = follow_block(self.stage, frame, guess, self.last, position)
        if error > LOST * self.usual + LOST_BY:
            pose, self.last, error = find_block(self.stage, frame, self.goal.centroid, position)
        self.usual = 0.8 * self.usual + 0.2 * error
        self.seen = [pose] if moving else [*self.seen, pose]
        self.belief = Belief(np.mean(self.seen, axis=0), position, self.state[2:4].copy(), moving)
        return self.belief

    def _look(self, frame: Frame) -> Belief:
        """Everything from nothing; an agent that hides is where its commands have drawn it after a while."""
        agent = find_agent(self.stage, frame)
        if agent is None and len(self.commands) >= HIDDEN:
            agent = self.commands[-1]
        pose, self.last, self.usual = find_block(self.stage, frame, self.goal.centroid, agent)
        self.seen = [pose]
        self.state = np.zeros(13)
        if agent is not None:
            self.state[:2] = agent
        self.belief = Belief(pose, agent, np.zeros(2))
        return self.belief

    def _predict(self, pose: Array) -> bool:
        """Carry the state through the last command, from the believed pose; whether the block moves."""
        self.state[X : ANGLE + 1] = self.model.centre_pose(pose)
        before = self.state[X : ANGLE + 1].copy()
        run(self.model.law, self.state, self.commands[-1][None], self.model.drive.substeps)
        return bool(np.abs(self.state[X : ANGLE + 1] - before).max() > 0)
