"""Worlds behind one small interface: reset, step, picture.  What a policy sees of them are observations alone."""

from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from expert.errors import InvalidProblem
from expert.world.values import require

Image = NDArray[np.uint8]
Observation = dict[str, Any]


class Outcome(NamedTuple):
    """After a step: what is seen, whether the world calls it success, and how much of the goal is covered."""

    observation: Observation
    success: bool
    coverage: float


class World(Protocol):
    """One task, many episodes."""

    def reset(self, seed: int) -> Observation: ...
    def step(self, command: ArrayLike) -> Outcome: ...
    def picture(self) -> Image: ...


@dataclass(frozen=True, kw_only=True)
class Spoiler:
    """A worse camera: less light (factor), noise (standard deviation of 255), JPEG of a quality from 1 to 100; None: no JPEG."""

    light: float = 1.0
    noise: float = 0.0
    jpeg: int | None = None

    def __post_init__(self) -> None:
        require(0 < self.light <= 1, "light", "a factor above 0, at most 1", self.light)
        require(0 <= self.noise < np.inf, "noise", "grey levels >= 0", self.noise)
        ok = self.jpeg is None or 1 <= self.jpeg <= 100
        require(ok, "jpeg", "null, or a quality from 1 to 100", self.jpeg)

    def __call__(self, image: Image, rng: np.random.Generator) -> Image:
        """The image as that camera gives it."""
        spoiled = self.light * image + self.noise * rng.standard_normal(image.shape)
        levels = np.clip(np.rint(spoiled), 0, 255).astype(np.uint8)
        if self.jpeg is None:
            return levels
        blue_first = np.ascontiguousarray(levels[..., ::-1])
        _, code = cv2.imencode(".jpg", blue_first, [cv2.IMWRITE_JPEG_QUALITY, self.jpeg])
        return np.asarray(cv2.imdecode(code, cv2.IMREAD_COLOR), dtype=np.uint8)[..., ::-1]


class PushT:
    """gym-pusht.  Observations: {"pixels": (96, 96, 3) uint8} or {"state": (5,)}.

    damping and block_cog: of the environment, which a policy is not told.  Raises InvalidProblem where it is not installed.
    """

    def __init__(
        self,
        observation: str = "pixels",
        spoiler: Spoiler | None = None,
        damping: float | None = None,
        block_cog: tuple[float, float] | None = None,
    ) -> None:
        require(observation in ("pixels", "state"), "observation", "pixels or state", observation)
        try:
            import gym_pusht  # noqa: F401  (registers the environment)
            import gymnasium
        except ImportError as error:
            remedy = "pip install 'certified-manipulation[pusht]' && pip install --no-deps gym-pusht==0.1.8"
            raise InvalidProblem("world", expected="gym-pusht", got=str(error), remedy=remedy) from error
        self.observation, self.spoiler = observation, spoiler or Spoiler()
        self.environment = gymnasium.make(
            "gym_pusht/PushT-v0", obs_type=observation, damping=damping, block_cog=block_cog
        )
        self.rng = np.random.default_rng(0)

    def reset(self, seed: int) -> Observation:
        """Begin the episode of a seed."""
        self.rng = np.random.default_rng(seed)
        seen, _ = self.environment.reset(seed=seed)
        return self._observed(seen)

    def step(self, command: ArrayLike) -> Outcome:
        """Send the agent towards a command (2,) for a tenth of a second."""
        seen, _, success, _, info = self.environment.step(np.asarray(command, dtype=np.float32))
        return Outcome(self._observed(seen), bool(success), float(info["coverage"]))

    def picture(self) -> Image:
        """A frame (680, 680, 3) for videos."""
        return np.asarray(self.environment.render(), dtype=np.uint8)

    def _observed(self, seen: Any) -> Observation:
        if self.observation == "pixels":
            seen = self.spoiler(seen, self.rng)
        return {self.observation: seen}
